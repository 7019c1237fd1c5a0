"""A recording of a drive axis alone is judged by `rig diagnose`, and never fitted as tissue."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from api.cli.app import build
from rig.config.table import parse
from rig.errors import DataError, UsageError
from rig.intake.mapping import DataMapping
from rig.intake.proposal import Proposal, propose
from rig.recording.sessions import SESSION_FILE, open_session
from rig.results.incoming import came_in_result
from rig.trials.recorded import trial_of
from tests.data import recording

INERTIA, FRICTION, TURN_S, SWING = 0.5, 0.3, 4.0, 0.8
AXES = {"franka": "franka_joint", "emps": "emps", "sts3215": "servo_sts3215", "rack": "rack_pinion"}
MAPPINGS = Path("examples/mappings")
TABLE = """
[[tables]]
files = "*.csv"
lever_mm = 1000.0
time = { column = "time", unit = "s" }
columns.force = { column = "q2_tau_J", unit = "N m" }
columns.position = { column = "q2", unit = "rad" }
"""


def rig(*arguments: object) -> Result:
    return CliRunner().invoke(build(str(arguments[0])), [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def joint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A joint that swings, with the torque of its inertia and of dry friction."""
    folder, random = tmp_path_factory.mktemp("arm") / "joint", np.random.default_rng(2)
    folder.mkdir()
    time_s, rate = np.arange(0, 20, 0.005), 2 * np.pi / TURN_S
    angle, speed = -SWING * np.cos(rate * time_s), SWING * rate * np.sin(rate * time_s)
    torque = INERTIA * SWING * rate**2 * np.cos(rate * time_s) + FRICTION * np.sign(speed)
    torque += random.normal(0, 0.01, time_s.size)
    rows = zip(time_s, angle, speed, torque, strict=True)
    body = "".join(f"{a:.3f},{b:.6f},{c:.6f},{d:.5f}\n" for a, b, c, d in rows)
    (folder / "swing.csv").write_text(f"time,q2,dq2,q2_tau_J\n{body}")
    return folder


def mapped(tmp_path: Path, axis: str = "[axis]", stated: str = "") -> Path:
    (tmp_path / "joint.toml").write_text(f"{stated}\n{TABLE}{axis}\n")
    return tmp_path / "joint.toml"


def test_files_of_an_arm_s_joint_are_proposed_as_an_axis_and_the_next_step_is_right(
    joint: Path, tmp_path: Path
) -> None:
    said = rig("import", joint, "--out", tmp_path / "made", "--yes")
    assert said.exit_code == 0, said.output
    assert "axis = {" in (tmp_path / "made.toml").read_text()
    words = " ".join(said.output.split())
    assert "a drive axis has no tissue; `rig diagnose` of" in words and "mend these files" not in words
    for place in (tmp_path / "made", joint):
        refused = rig("fit", place, "--out", tmp_path / "made", "--yes")
        assert isinstance(refused.exception, UsageError)
        assert "is a drive axis" in str(refused.exception) and "`rig diagnose` of" in str(refused.exception)
        assert str(joint) in str(refused.exception)
    assert not (tmp_path / "made" / "fit.json").exists()
    again = rig("diagnose", joint, "--mapping", tmp_path / "made.toml", "--out", tmp_path / "found")
    assert "coulomb_friction" in again.output, again.output
    assert isinstance(rig("diagnose", tmp_path / "made").exception, UsageError)


def test_a_mapping_without_an_axis_makes_tissue_of_it(joint: Path, tmp_path: Path) -> None:
    """A joint that swings presses nothing, and that is what is said of it."""
    said = rig("fit", joint, "--mapping", mapped(tmp_path, axis=""), "--out", tmp_path / "out")
    assert isinstance(said.exception, DataError), said.output
    assert "no trial gives a curve" in str(said.exception)


def test_a_user_s_note_makes_no_axis_and_a_lost_list_no_tissue(joint: Path, tmp_path: Path) -> None:
    note = 'session.notes = { drive_axis = "EC-i 40" }'
    rig("import", joint, "--mapping", mapped(tmp_path, axis="", stated=note), "--out", tmp_path / "noted")
    session = open_session(tmp_path / "noted")
    session.refuse_axis()
    assert session.info.notes["drive_axis"] == "EC-i 40"
    assert not trial_of("swing", session.recording("swing")).of_axis
    rig("import", joint, "--mapping", mapped(tmp_path), "--out", tmp_path / "made")
    (tmp_path / "made" / SESSION_FILE).unlink()
    with pytest.raises(UsageError, match=re.escape(str(joint))):
        open_session(tmp_path / "made").refuse_axis()


def test_gaps_of_an_axis_are_told(joint: Path, tmp_path: Path) -> None:
    """Half a second of twenty is missing."""
    (tmp_path / "in").mkdir()
    rows = (joint / "swing.csv").read_text().splitlines()
    (tmp_path / "in" / "swing.csv").write_text("\n".join(rows[:1000] + rows[1100:]) + "\n")
    rig("import", tmp_path / "in", "--mapping", mapped(tmp_path), "--out", tmp_path / "made")
    (recording,) = came_in_result(open_session(tmp_path / "made")).recordings
    assert recording.quality == "usable" and any("axis" in reason and "gap" in reason for reason in recording.reasons)


@pytest.mark.parametrize("header", ["time_s,torque (N m),angle (deg)", "time_s,force (N),target pos,pos (mm)"])
def test_a_torque_at_an_angle_and_a_bench_with_a_set_point_are_no_axis(tmp_path: Path, header: str) -> None:
    (tmp_path / "in").mkdir()
    cells = header.count(",")
    rows = "".join(f"{0.01 * k}" + f",{0.1 * k}" * cells + "\n" for k in range(40))
    (tmp_path / "in" / "a.csv").write_text(f"{header}\n{rows}")
    assert "axis" not in propose(tmp_path / "in").tree


def proposed(folder: Path, header: str) -> Proposal:
    folder.mkdir()
    rows = "".join(
        ",".join(f"{0.01 * k * (1 + at):g}" for at in range(header.count(",") + 1)) + "\n" for k in range(40)
    )
    (folder / "a.csv").write_text(f"{header}\n{rows}")
    return propose(folder)


@pytest.mark.parametrize(
    "header",
    [
        "time_s,load,encoder position", "time_s,load,position,target position", "time_s,torque (N m),joint angle (deg)",
        "time_s,torque (N m),motor angle (deg)",
    ],
)  # fmt: skip
def test_what_may_be_tissue_or_a_drive_is_asked_and_nothing_is_usual(tmp_path: Path, header: str) -> None:
    found = proposed(tmp_path / "in", header)
    *units, asked = found.questions
    assert asked.usual == "" and "a drive axis alone or of tissue" in asked.text
    with pytest.raises(UsageError, match="still open"):
        parse(DataMapping, tomllib.loads(found.text), "proposed")
    with pytest.raises(UsageError, match="neither axis nor tissue"):
        asked.value("N")
    answers = ["N" if "force" in one.text else "mm" for one in units]
    for said in ("axis", "tissue", "axis"):
        mapping = parse(DataMapping, tomllib.loads(found.answered([*answers, said]).text), "proposed")
        assert (mapping.axis is not None) is (said == "axis")


def test_what_a_load_cell_feels_at_a_motor_s_position_is_no_axis(tmp_path: Path) -> None:
    found = proposed(tmp_path / "in", "time_s,Load cell,Motor position")
    assert "axis" not in found.tree and "drive axis" not in " ".join(one.text for one in found.questions)


@pytest.mark.parametrize(("speed_mm_s", "wrong"), [(1100.0, False), (110.0, True), (11000.0, True)])
def test_a_stated_speed_is_held_against_the_motion_of_an_axis(
    joint: Path, tmp_path: Path, speed_mm_s: float, wrong: bool
) -> None:
    """A swing is at most 2 pi 0.8 rad / 4 s, 1257 mm/s at the lever of a metre."""
    mapping = mapped(tmp_path, stated=f"stated = {{ speed_mm_s = {speed_mm_s} }}")
    said = rig("import", joint, "--mapping", mapping, "--out", tmp_path / "made")
    assert ("but the axis moves at" in " ".join(said.output.split())) is wrong
    found = rig("diagnose", joint, "--mapping", mapping, "--out", tmp_path / "found", "--json", tmp_path / "said.json")
    assert found.exit_code in (0, 1), found.output
    texts = [one["text"] for one in json.loads((tmp_path / "said.json").read_text())["data_quality"]]
    assert any("but the axis moves at" in text for text in texts) is wrong


@pytest.mark.parametrize("name", AXES)
def test_axes_of_others_are_never_fitted_as_tissue(name: str, tmp_path: Path) -> None:
    (mapping,) = (path for path in MAPPINGS.glob("*.toml") if name in path.name)
    said = rig("import", recording(AXES[name]), "--mapping", mapping, "--out", tmp_path / "made")
    assert said.exit_code == 0 and "mend these files" not in said.output
    refused = rig("fit", tmp_path / "made")
    assert isinstance(refused.exception, UsageError) and "`rig diagnose` of" in str(refused.exception)
