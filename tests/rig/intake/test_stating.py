"""What labels state of a recording: numbers in the project's units, held against its motion as any statement is."""

import math
from pathlib import Path

import numpy as np
import pytest

from mock_devices.testing.made.synthetic import Bench
from rig.errors import DataError, RigError
from rig.intake.mapping import MAPPING_FILE, RecordingFacts
from rig.intake.stating import StatedFacts, stated_of
from rig.trials.reading import trials_of
from rig.trials.trial import TrialSet
from tests.rig.recording.measured import run, write

LABELS = {"speed": "300", "depth": "8000", "by": "A. B.", "warm": "21,5", "unknown": "", "word": "fast"}


def stated(**facts: str | float) -> StatedFacts:
    return stated_of(RecordingFacts.model_validate(facts), LABELS, "a.csv")


@pytest.mark.parametrize(
    ("key", "said", "expected"),
    [
        ("speed_mm_s", "{speed} mm/min", 5.0),
        ("speed_mm_s", "{speed}", 300.0),
        ("speed_mm_s", "0.{speed} m/s", 300.0),
        ("depth_mm", "{depth} um", 8.0),
        ("depth_mm", "{depth}e-3", 8.0),
        ("surface_mm", "-{depth} µm", -8.0),
        ("temperature_C", "{warm} °C", 21.5),
        ("depth_mm", 3.0, 3.0),
    ],
)
def test_a_label_with_its_unit_is_a_number_in_the_projects(key: str, said: str | float, expected: float) -> None:
    assert getattr(stated(**{key: said}), key) == pytest.approx(expected)


def test_what_nobody_says_is_unknown() -> None:
    found = stated(depth_mm="{unknown} um")
    assert all(math.isnan(value) for value in found[:4])
    assert (found.operator, found.more) == ("", {})
    assert stated(operator="Dr {by}").operator == "Dr A. B."


@pytest.mark.parametrize(
    ("key", "said", "reason"),
    [
        ("speed_mm_s", "{word}", r"a.csv: speed_mm_s = '\{word\}' says 'fast' here, which is no number"),
        ("speed_mm_s", "{speed} furlongs", r"says '300 furlongs' here, which is no number with a unit"),
        ("speed_mm_s", "{speed} mm", r"speed_mm_s = '\{speed\} mm': 'mm' is no unit of velocity; known are mm/s"),
        ("depth_mm", "-{depth}", r"depth_mm = '-\{depth\}' says -8000 here; it must be above 0"),
        ("depth_mm", "{deep}", r"asks for 'deep'; there are by, depth"),
        ("operator", "{by.real}", r"asks for 'by.real'; there are by, depth"),
        ("operator", "{by:>1000000000}", r"asks for 'by:>1000000000'; there are by, depth"),
        ("operator", "Dr {by", r"'Dr \{by' has a brace that belongs to no name"),
    ],
)
def test_a_label_that_states_no_such_number_is_refused_with_its_place(key: str, said: str, reason: str) -> None:
    with pytest.raises(RigError, match=reason):
        stated(**{key: said})


TABLE = """
time = { column = "time_s" }
columns.force = { column = "force_N" }
columns.position = { column = "position_mm" }
"""
SPEEDS_MM_S = (5.0, 10.0, 20.0)


def rows(speed_mm_s: float, start_s: float = 0.0) -> list[str]:
    """A cycle of 8 mm, as lines of time, force and position."""
    cycle = Bench(rate_Hz=100.0).cycle(speed_mm_s, int(speed_mm_s))
    columns = np.stack([start_s + cycle.time_s, cycle.force_N, cycle.position_mm], axis=1)
    return [",".join(f"{value:.6f}" for value in row) for row in columns]


def named(folder: Path, factor: float) -> TrialSet:
    """Cycles whose files are named by speed (mm/min) times ``factor``, depth (um) and a person."""
    mapping = (
        'stated = { speed_mm_s = "{speed} mm/min", depth_mm = "{depth} um", operator = "{by}" }\n'
        f'[[tables]]\nfiles = "gel_{{speed}}_{{depth}}_{{by}}.csv"\n{TABLE}'
    )
    files = {
        f"gel_{60 * factor * speed:g}_8000_AB.csv": "\n".join(["time_s,force_N,position_mm", *rows(speed)])
        for speed in SPEEDS_MM_S
    }
    return trials_of(run(write(folder / "in", {MAPPING_FILE: mapping, **files})))


def test_speed_depth_and_operator_come_from_the_names_of_files(tmp_path: Path) -> None:
    found = named(tmp_path, factor=1.0)
    assert {trial.speed_mm_s for trial in found.trials} == {5.0, 10.0, 20.0}
    assert {(trial.depth_mm, trial.labels["operator"]) for trial in found.trials} == {(8.0, "AB")}
    assert not [finding for finding in found.findings if finding.kind in ("speed", "depth")]


def test_a_speed_in_a_name_that_is_not_the_motions_is_said(tmp_path: Path) -> None:
    found = named(tmp_path, factor=10.0)
    said = [finding.text for finding in found.findings if finding.kind == "speed"]
    assert len(said) == 3
    assert any("stated speed 50 mm/s, but the tip loads at 5 mm/s" in text for text in said)


def test_a_column_says_the_speed_of_each_recording_in_a_table(tmp_path: Path) -> None:
    lines = ["sample,speed,time_s,force_N,position_mm"]
    for number, speed in enumerate(SPEEDS_MM_S):
        lines += [f"gel {number},{60 * speed:g} mm/min,{row}" for row in rows(speed)]
    mapping = (
        'recording = "{sample}"\nstated = { speed_mm_s = "{speed}" }\n'
        f'[[tables]]\nfiles = "all.csv"\nlabel = {{ sample = "sample", speed = "speed" }}\n{TABLE}'
    )
    session = run(write(tmp_path / "in", {MAPPING_FILE: mapping, "all.csv": "\n".join(lines)}))
    assert [trial.speed_mm_s for trial in session.trials] == pytest.approx(SPEEDS_MM_S)


def test_a_name_without_the_number_ends_the_import_with_its_file(tmp_path: Path) -> None:
    mapping = f'stated = {{ speed_mm_s = "{{speed}} mm/min" }}\n[[tables]]\nfiles = "gel_{{speed}}.csv"\n{TABLE}'
    source = write(
        tmp_path / "in", {MAPPING_FILE: mapping, "gel_slow.csv": "time_s,force_N,position_mm\n0,0,0\n1,1,1\n"}
    )
    with pytest.raises(DataError, match=r"gel_slow.csv.*speed_mm_s = '\{speed\} mm/min' says 'slow mm/min' here"):
        run(source)
    assert not (tmp_path / "out").exists()
