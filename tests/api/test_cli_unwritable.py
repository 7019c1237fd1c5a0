"""Where a result could not be written is told before anything is begun: one sentence, exit code 2, nothing touched."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from api.cli.app import main
from mock_devices.testing.made.synthetic import Bench, write_made_session
from mock_devices.testing.models import index_model
from tests.api.test_cli_failures import REFUSED

Rig = Callable[[str], str]
# Whatever would be begun: a bench, a calibration, reading, fitting, one of several sessions.
WORK = (
    "api.cli.live.bench_for", "api.cli.calibrate.calibrate_force", "api.cli.calibrate.calibrate_axis",
    "api.cli.calibrate.calibrate_dynamics", "api.cli.calibrate.calibrate_glove", "api.operations.fit.opened",
    "api.operations.diagnose.opened", "api.operations.cohort.cohort.Task.of",
)  # fmt: skip
OUT = {
    "capture": "capture protocol.toml --out {out}",
    "track": "track --model model.json --force 1 --out {out}",
    "threshold": "threshold --model model.json --up-to 5 --out {out}",
    "calibrate force": "calibrate force --out {out}",
    "calibrate axis": "calibrate axis --out {out}",
    "calibrate dynamics": "calibrate axis --dynamics --out {out}",
    "calibrate glove": "calibrate glove --out {out}",
    "fit": "fit session --out {out}",
    "fit of several": "fit session second --cohort --out {out}",
    "diagnose": "diagnose session --out {out}",
    "diagnose of several": "diagnose session second --out {out}",
    "report of several": "report session second --out {out}",
    "demo": "demo --out {out}",
    "import": "import measured --out {out}",
}
NOT_A_FOLDER = "taken is a file, not a folder; give another place"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What commands are given: a protocol, a model, a session, data without a mapping; and a file in the way."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "protocol.toml").write_text('kind = "indentation"\ndepth_mm = 5\n')
    index_model(0.12, 0.22, 0.01, force_N=11.0).save(folder / "model.json")
    write_made_session(folder / "session", Bench(rate_Hz=250.0).cycles(trials=1, speeds_mm_s=(10.0,)))
    (folder / "measured").mkdir()
    rows = "".join(f"0.{k},{k},{2 * k}\n" for k in range(8))
    (folder / "measured" / "a.csv").write_text(f"time_s,force_N,depth_mm\n{rows}")
    (folder / "taken").write_text("mine")
    (folder / "closed").mkdir()
    return folder


@pytest.fixture
def rig(made: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Rig:
    """Runs a command line that is to be refused; returns the sentence."""
    monkeypatch.chdir(made)
    for work in WORK:
        monkeypatch.setattr(work, lambda *_, **__: pytest.fail("the work was begun"))

    def refused(line: str) -> str:
        before = contents(made)
        monkeypatch.setattr(sys, "argv", ["rig", *line.split()])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 2
        (sentence,) = [said for said in capsys.readouterr().err.splitlines() if said.startswith("rig: ")]
        assert contents(made) == before
        return sentence

    return refused


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() if path.is_file() else b"" for path in folder.rglob("*")}


@pytest.fixture
def closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder of this name may not be written to, also where the tests may do everything."""
    asked = os.access

    def access(path: str | Path, mode: int) -> bool:
        return asked(path, mode) and not (mode & os.W_OK and Path(path).name == "closed")

    monkeypatch.setattr(os, "access", access)


@pytest.mark.parametrize("name", OUT)
def test_a_place_below_a_file_is_refused_before_the_work(rig: Rig, name: str) -> None:
    said = rig(OUT[name].format(out="taken/deep/out"))
    assert said.startswith("rig: taken/deep/out") and said.endswith(NOT_A_FOLDER)


@pytest.mark.parametrize("name", OUT)
def test_a_folder_that_may_not_be_written_to_is_refused_before_the_work(rig: Rig, closed: None, name: str) -> None:
    said = rig(OUT[name].format(out="closed/out"))
    assert said.startswith("rig: closed/out")
    assert said.endswith("closed may not be written to; give another place, or change its permissions")


@pytest.mark.parametrize(
    ("target", "sentence"),
    [
        ("closed", "closed: is a folder; give the name of a file"),
        ("taken/said.json", NOT_A_FOLDER),
        ("closed/said.json", "closed may not be written to; give another place, or change its permissions"),
        ("missing/said.json", "--json missing/said.json: its folder does not exist; make it, or give another file"),
    ],
)
@pytest.mark.parametrize("name", REFUSED)
def test_a_result_that_could_not_be_written_is_refused_by_every_command_before_anything_else(
    rig: Rig, closed: None, name: str, target: str, sentence: str
) -> None:
    assert rig(" ".join([name, *REFUSED[name], "--json", target])).endswith(sentence)
