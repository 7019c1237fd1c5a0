"""A command that ends without a result writes to its --json why, and leaves alone what it did write."""

import inspect
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from api.cli.app import COMMANDS, build
from rig.errors import CheckFailed, RigError
from tests.rig.recording.measured import measured, run

REFUSED = {
    "capture": ["no-such.toml", "--out", "x"],
    "track": ["--model", "no-such.json", "--force", "5"],
    "simulate": ["--model", "no-such.json", "--reference", "step:5"],
    "threshold": ["--model", "no-such.json", "--up-to", "5"],
    "fit": ["no-such"],
    "report": ["no-such"],
    "diagnose": ["no-such"],
    "protocol": ["check", "no-such.toml"],
    "verify": ["no-such"],
    "repair": ["no-such.mcap", "--out", "x.mcap"],
    "import": ["no-such", "--out", "x"],
    "export": ["no-such", "--out", "x"],
    "reset": ["--config", "no-such.toml"],
    "doctor": ["--config", "no-such.toml"],
    "devices": ["no-such"],
    "find": ["no-such", "--ask"],
    "replay": ["no-such"],
    "catalogue": ["sessions", "--sessions", "no-such"],
    "subject": ["list", "--sessions", "no-such"],
    "calibrate": ["force", "--config", "no-such.toml"],
}


def fails(*arguments: str | Path) -> RigError:
    error = CliRunner().invoke(build(str(arguments[0])), [str(one) for one in arguments]).exception
    assert isinstance(error, RigError), error
    return error


def test_every_command_with_json_is_tried_here() -> None:
    takes = (name for name in COMMANDS if "json_file" in inspect.signature(_function(name)).parameters)
    assert set(takes) == set(REFUSED)


def _function(name: str) -> Callable[..., object]:
    (command,) = build(name).registered_commands
    assert command.callback
    return command.callback


@pytest.mark.parametrize("name", REFUSED)
def test_the_reason_takes_the_place_of_an_older_result(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "said.json"
    file.write_text("{}")
    error = fails(name, *REFUSED[name], "--json", file)
    assert json.loads(file.read_text()) == {
        "version": 1, "error": type(error).__name__, "exit_code": 2, "reason": str(error)
    }  # fmt: skip
    assert "no-such" in str(error)


def test_a_result_that_was_written_before_the_check_failed_stays(tmp_path: Path) -> None:
    session = run(measured(tmp_path / "measured"))
    session.path("trial_02").unlink()
    error = fails("verify", session.folder, "--json", tmp_path / "said.json")
    assert isinstance(error, CheckFailed) and error.exit_code == 1
    said = json.loads((tmp_path / "said.json").read_text())
    assert not said["ok"] and "error" not in said
