"""`rig calibrate axis --dynamics` on the mock bench, over the wire, against the mock axis' own physics."""

import json
from pathlib import Path

import pytest

from mock_devices.parameters import Axis
from mock_devices.testing.commands import rig
from rig.config.calibration_files import read_dynamics
from tests.controller.commissioning.test_axis_dynamics import MockMechanics, sine_lag_s

pytestmark = [pytest.mark.bench, pytest.mark.extra, pytest.mark.xdist_group("commands")]


TRIES = 3  # what a computer that was busy has spoilt is refused by its coherence, and is to be done again


@pytest.mark.by_hand
def test_the_mock_axis_is_found_as_its_physics_answer_a_sine(tmp_path: Path) -> None:
    for _ in range(TRIES):
        said = rig("calibrate", "axis", "--dynamics", "--json", "result.json", folder=tmp_path)
        if "coherent to" not in said.err:
            break
    assert said.code == 0, said.err
    found = read_dynamics(tmp_path / json.loads((tmp_path / "result.json").read_text())["file"])
    axis = Axis()
    # 0.3 ms: the turn of the loop until the set-point leaves, which the mock's own clock does not see.
    assert found.total.s == pytest.approx(sine_lag_s(MockMechanics(axis), 8.0), abs=found.total.within_s + 3e-4)
    assert found.reversal.friction_A == pytest.approx(axis.coulomb_N / axis.force_per_current_N_A, abs=0.01)
    assert found.doubts == []
    assert f'dynamics = "{json.loads((tmp_path / "result.json").read_text())["file"]}"' in said.out
    assert "delay and lags" in said.out


def test_a_sweep_beyond_the_workspace_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    said = rig("calibrate", "axis", "--dynamics", "--from-mm", "58", folder=tmp_path)
    assert said.code == 2
    assert "--from-mm 58: sweeps go from" in said.err
    assert not (tmp_path / "calibration").exists()
