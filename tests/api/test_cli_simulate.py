"""`rig simulate` says its numbers before it draws: figures take longer than all that it says."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from api.cli.app import build
from api.operations.simulate import Played
from rig.errors import DataError

MODEL = Path(__file__).parents[2] / "examples" / "forearm-model.json"


def test_numbers_are_said_and_written_where_figures_cannot_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_ink(_played: Played, _out: Path) -> None:
        raise DataError("no ink")

    monkeypatch.setattr(Played, "draw", no_ink)
    file = tmp_path / "simulation.json"
    asked = ["simulate", "--model", str(MODEL), "--reference", "step:2,duration_s=1", "--json", str(file)]
    found = CliRunner().invoke(build("simulate"), asked)
    assert isinstance(found.exception, DataError)
    assert "Stability margins" in found.stdout
    assert "nyquist.svg" not in found.stdout
    assert json.loads(file.read_text())["peak_force_N"] > 2.0
