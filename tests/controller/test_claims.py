"""Who uses a bench: locks that end with their processes, and what stays behind where one was killed."""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import mkdtemp

import pytest

from controller import claims
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Wiring
from rig.errors import DeviceError
from rig.recording.ring import new_path, remove_abandoned

WIRING = Wiring(axis=Epos4Wiring(port="/dev/ttyAXIS"), force=BotaWiring(port="/dev/ttyFORCE"), tracker=None)
HOLD = """
import sys
from controller import claims
from rig.config.wiring import Wiring
claim = claims.take(Wiring.model_validate_json(sys.argv[1]), "http://127.0.0.1:8123")
print("taken", flush=True)
sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The state folder, of this test's process alone."""
    home = Path(mkdtemp(dir=tmp_path))
    monkeypatch.setenv("XDG_STATE_HOME", str(home))
    return home / "tissue-rig"


def other_process(wiring: Wiring = WIRING) -> "subprocess.Popen[str]":
    """A process that has claimed the bench."""
    arguments = [sys.executable, "-c", HOLD, wiring.model_dump_json()]
    process = subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout and process.stdout.readline() == "taken\n"
    return process


def end(process: "subprocess.Popen[str]") -> None:
    process.kill()
    process.communicate()


def test_a_bench_in_use_is_refused_naming_who_has_which_port() -> None:
    process = other_process()
    try:
        with pytest.raises(DeviceError, match="/dev/ttyAXIS is in use by") as refused:
            claims.take(WIRING)
        assert f"(process {process.pid})" in str(refused.value)
        assert "or use it at http://127.0.0.1:8123" in str(refused.value)
        found = claims.holder(WIRING)
        assert found and (found.pid, found.address) == (process.pid, "http://127.0.0.1:8123")
    finally:
        end(process)


def test_one_port_in_common_is_enough() -> None:
    process = other_process(WIRING.model_copy(update={"axis": Epos4Wiring(port="/dev/ttyOTHER")}))
    try:
        with pytest.raises(DeviceError, match="/dev/ttyFORCE is in use"):
            claims.take(WIRING)
    finally:
        end(process)
    claims.take(WIRING).release()


def test_a_bench_given_back_leaves_nothing(folder: Path) -> None:
    claim = claims.take(WIRING)
    assert claim.unfinished == ""
    assert len(claim.fds) == 2
    claim.release()
    claim.release()
    assert list(folder.iterdir()) == []
    assert claims.holder(WIRING) is None


def test_a_killed_session_is_told_to_all_that_follow_until_one_recovers() -> None:
    process = other_process()
    end(process)
    for _ in range(2):
        claim = claims.take(WIRING)
        assert f"process {process.pid}" in claim.unfinished
        assert "did not end in order; the tip may still be in the tissue" in claim.unfinished
        claim.release()
    claim = claims.take(WIRING)
    claim.finished = True
    claim.release()
    claim = claims.take(WIRING)
    assert claim.unfinished == ""
    claim.release()


def test_a_session_that_leaves_the_tip_inside_says_so_to_the_next() -> None:
    claim = claims.take(WIRING)
    claim.leave_note()
    claim.release()
    claim = claims.take(WIRING)
    assert f"process {os.getpid()}" in claim.unfinished
    claim.finished = True
    claim.release()


def test_a_loop_that_outlives_its_command_keeps_the_bench_until_it_has_left() -> None:
    claim = claims.take(WIRING)
    loop = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1.0)"], pass_fds=claim.fds)
    for fd in claim.fds:
        os.close(fd)  # as if this process had been killed
    path = next(claims.state_folder().glob("*ttyAXIS*"))
    path.write_text(path.read_text().replace(f'"pid": {os.getpid()}', '"pid": 999999999'))
    taken = claims.take(WIRING)
    assert loop.poll() is not None
    taken.finished = True
    taken.release()


def test_a_pseudo_terminal_opened_anew_is_another_bench() -> None:
    ours, theirs = os.openpty()
    wiring = WIRING.model_copy(update={"axis": Epos4Wiring(port=os.ttyname(theirs))})
    end(other_process(wiring))
    path = next(claims.state_folder().glob("*pts*"))
    claim = claims.take(wiring)
    assert claim.unfinished
    claim.release()
    path.write_text(path.read_text().replace('"node": "', '"node": "1'))
    claim = claims.take(wiring)
    assert claim.unfinished == ""
    claim.release()
    os.close(ours)
    os.close(theirs)


def test_a_file_of_something_else_hinders_nothing(folder: Path) -> None:
    claims.take(WIRING).release()
    (folder / "%2Fdev%2FttyAXIS.json").write_text("not ours")
    claim = claims.take(WIRING)
    assert claim.unfinished == ""
    claim.release()


def test_without_a_folder_of_its_own_the_one_for_temporary_files_serves(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path / "temporary"))
    claims.take(WIRING).release()
    assert (tmp_path / "temporary").is_dir()


def test_rings_of_killed_processes_are_removed_and_of_living_ones_kept() -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    mine = new_path()
    abandoned = mine.with_name(mine.name.replace(f"-{os.getpid()}-", f"-{gone.pid}-"))
    for path in (mine, abandoned):
        path.write_bytes(bytes(4096))
    remove_abandoned()
    assert mine.exists()
    assert not abandoned.exists()
    mine.unlink()
