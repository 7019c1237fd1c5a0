"""`rig replay`: a recorded stop becomes a test in one command, and other limits say at which row they differ."""

import runpy
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from api.cli.app import build
from controller.loop.modes import Mode
from rig.errors import CheckFailed, UsageError
from rig.results.replay import ReplayResult
from tests.controller.fake_bench import APPROACH, HOLD, PRESS, ZERO, FakeBench, wired
from tests.controller.replay.made import begin, recorded, session_of


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sensor freezes while the tip presses."""
    bench = FakeBench(wired(), position_mm=17.5)
    program = begin(bench, ZERO, APPROACH, PRESS, HOLD)
    bench.until(lambda: bench.loop.machine.step_index == 3)
    bench.force.frozen = True
    bench.until(lambda: bench.latched == "force_invalid")
    bench.until(lambda: bench.mode is Mode.SAFE)
    return session_of(recorded(bench, program), tmp_path_factory.mktemp("made") / "frozen")


def rig(*arguments: str | Path) -> Any:
    return CliRunner().invoke(build("replay"), ["replay", *map(str, arguments)])


def test_a_recorded_stop_becomes_a_test_that_passes_alone(session: Path, tmp_path: Path) -> None:
    file = tmp_path / "test_frozen.py"
    said = rig(session, "--as-test", file, "--json", tmp_path / "replay.json")
    assert said.exit_code == 0, (said.output, said.exception)
    (one,) = ReplayResult.read(tmp_path / "replay.json").recordings
    assert one.differing_rows == 0 and one.stops[0].startswith("force_invalid: the force sensor repeats the same value")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["replay.json", "test_frozen", "test_frozen.py"]
    runpy.run_path(str(file))["test_the_loop_decides_as_it_did"]()
    file.write_text(file.read_text().replace("repeats the same value", "repeats another value"))
    with pytest.raises(AssertionError):
        runpy.run_path(str(file))["test_the_loop_decides_as_it_did"]()


def test_other_limits_are_said_with_the_row_and_no_test_is_written(session: Path, tmp_path: Path) -> None:
    said = rig(session, "--set", "limits.force_N=2", "--as-test", tmp_path / "test_x.py")
    assert isinstance(said.exception, CheckFailed)
    assert "trial_001.mcap: row " in str(said.exception) and "force_limit: force " in str(said.exception)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--as-test", "frozen.py"), "pytest finds files that are called test_"),
        (("--as-test", "test_frozen.1.py"), "of letters, digits and underscores; give such a name"),
        (("--only", "track*"), "no recording is called like 'track\\*'"),
        (("--set", "limits.force=2"), "unknown key limits.force; nearest valid key: force_N"),
    ],
)
def test_wrong_use_is_one_sentence(session: Path, arguments: tuple[str, ...], sentence: str) -> None:
    said = rig(session, *arguments)
    assert isinstance(said.exception, UsageError)
    with pytest.raises(UsageError, match=sentence):
        raise said.exception


def pytest_in(folder: Path) -> "subprocess.CompletedProcess[str]":
    """In a folder that is no checkout, as whoever was given the test runs it."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-W", "error"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("listed", [True, False], ids=["whole", "after a crash"])
@pytest.mark.parametrize("name", ["plain", 'it\'s "C:\\new" \'\'\'and\'\'\' """so"""'])
def test_the_test_runs_in_a_folder_of_its_own(session: Path, listed: bool, name: str, tmp_path: Path) -> None:
    place = shutil.copytree(session, tmp_path / name)
    if not listed:
        (place / "session.json").unlink()
    (tmp_path / "away").mkdir()
    said = rig(place, "--as-test", tmp_path / "away" / "test_it.py")
    assert said.exit_code == 0, (said.output, said.exception)
    shutil.rmtree(place)
    ran = pytest_in(tmp_path / "away")
    assert ran.returncode == 0 and "1 passed" in ran.stdout, ran.stdout + ran.stderr


def test_a_check_that_was_broken_since_fails_it(session: Path, tmp_path: Path) -> None:
    assert rig(session, "--as-test", tmp_path / "test_it.py").exit_code == 0
    broken = "from controller.devices.health import StreamHealth\nStreamHealth.frozen = property(lambda _: False)\n"
    (tmp_path / "conftest.py").write_text(broken)
    ran = pytest_in(tmp_path)
    assert ran.returncode == 1 and "1 failed" in ran.stdout and "force_invalid" in ran.stdout, ran.stdout + ran.stderr


def test_what_is_there_is_not_overwritten(session: Path, tmp_path: Path) -> None:
    file = tmp_path / "test_frozen.py"
    file.write_text("mine\n")
    assert isinstance(rig(session, "--as-test", file).exception, UsageError)
    assert file.read_text() == "mine\n"


def test_a_place_without_a_session_is_refused(tmp_path: Path) -> None:
    assert isinstance(rig(tmp_path / "nothing").exception, UsageError)
