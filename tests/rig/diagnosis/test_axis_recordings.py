"""Real axes: a cause by name where the data tell it, and never one for certain that is not there."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from api.cli.app import build
from mock_devices.testing.real_data import ROOT
from rig.config.table import load
from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.axis_run import diagnose_axis
from rig.intake.axis import AxisData, read_axis
from rig.intake.mapping import AxisFacts, DataMapping
from rig.simulation.servo import read_models
from tests.data import recording

EXAMPLES = ROOT / "examples"


@cache
def of(name: str) -> tuple[AxisData, AxisFacts]:
    mapping = load(DataMapping, EXAMPLES / "mappings" / f"{name}.toml")
    assert mapping.axis is not None
    return read_axis(recording(name), mapping), mapping.axis


@cache
def diagnosed(name: str) -> Diagnosis:
    """The diagnosis, beside models of others where there are some; two tests look at one of them."""
    data, facts = of(name)
    models = EXAMPLES / "axis_models" / f"{name}.toml"
    return diagnose_axis(data, name, facts, read_models(models) if models.exists() else None)


def test_the_ball_screw_has_friction_and_pulses_left_out_are_predicted_better_than_by_its_makers() -> None:
    found = diagnosed("emps")
    assert [one.effects for one in found.findings] == [
        ("coulomb_friction",), ("viscous_friction",), ("asymmetric_friction",)
    ]  # fmt: skip
    assert found.findings[0].parameters["coulomb"].value == pytest.approx(20.4, rel=0.03)
    assert found.base["inertia"].value == pytest.approx(95.1, rel=0.02)
    (pulses,) = (one for one in found.simulated if not one.fitted)
    assert found.axis is not None
    assert found.axis.left_out_percent == pulses.after_percent
    assert pulses.after_percent < pulses.reference_percent["asymmetric"] < 5.40 < pulses.before_percent


def test_of_a_recording_left_out_only_set_point_and_excitation_are_used() -> None:
    data, facts = of("emps")
    fitted, left = data.recordings
    shifted = left.position[::-1] + 1.0
    other = AxisData((fitted, type(left)(**{**vars(left), "position": np.ascontiguousarray(shifted)})), data.units)
    assert diagnose_axis(other, "emps", facts).axis == diagnosed("emps").axis


def test_a_slow_joint_has_coulomb_friction_or_none_for_certain() -> None:
    found = diagnosed("franka_joint")
    assert found.findings[0].effects[0] == "coulomb_friction"
    assert found.findings[0].parameters["coulomb"].value == pytest.approx(0.35, rel=0.1)
    assert found.verdict == "explained" or all(one.provisional for one in found.findings)


def test_one_move_one_way_names_nothing_for_certain() -> None:
    found = diagnosed("rack_pinion")
    assert found.verdict == "unexplained"
    assert all(one.provisional for one in found.findings)
    assert found.not_testable["coulomb_friction"] == "the axis moves one way only"


def test_servos_at_ten_hertz_are_not_judged() -> None:
    found = diagnosed("servo_sts3215")
    assert (found.verdict, found.findings) == ("not judged", ())


def test_the_command_writes_what_was_left_out_in_percent(tmp_path: Path) -> None:
    file = tmp_path / "found.json"
    folder, mapping = recording("emps"), EXAMPLES / "mappings" / "emps.toml"
    done = CliRunner().invoke(
        build("diagnose"), ["diagnose", str(folder), "--mapping", str(mapping), "--json", str(file)]
    )
    assert done.exit_code == 0, done.output
    assert json.loads(file.read_text())["axis"]["left_out_percent"] < 5.40
    assert "DATA_EMPS_PULSES (left out)" in done.output
