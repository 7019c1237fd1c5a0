"""Units of force and length in a header, behind an underscore, in a row of units and in a line above the table.

Factors are those of NIST SP 811, B.8.
"""

from pathlib import Path

import numpy as np
import pytest

from rig.intake.proposal import propose
from rig.intake.units import unit_of
from tests.rig.intake.instruments import text
from tests.rig.intake.test_foreign import FORCE_N, TIME_S, WAY_MM, came_in, check, lines

LBF_N, OZF_N = 4.4482216152605, 0.278013850953781
FORCES = {
    "µN": 1e-6, "uN": 1e-6, "mN": 1e-3, "kN": 1e3, "gf": 9.80665e-3, "kgf": 9.80665, "ozf": OZF_N, "ozF": OZF_N,
    "oz": OZF_N, "lbf": LBF_N, "lbF": LBF_N, "kip": 1e3 * LBF_N, "micronewtons": 1e-6, "millinewton": 1e-3,
    "pounds": LBF_N, "pound-force": LBF_N, "grams-force": 9.80665e-3,
}  # fmt: skip
LENGTHS = {
    "µm": 1e-3, "um": 1e-3, "nm": 1e-6, "micrometres": 1e-3, "nanometers": 1e-6, "inch": 25.4, "in.": 25.4,
    "mil": 0.0254, "mils": 0.0254, "thou": 0.0254, "ft": 304.8, "Å": 1e-7,
}  # fmt: skip
# Of a unit: what stands above rows of time, way and force, and whether a person is still asked.
FORCE_HEADS = {
    "in brackets": "Time (s),Position (mm),Force ({})\n", "behind": "Time_s,Position_mm,Force_{}\n",
    "in a row": "Time,Position,Force\ns,mm,{}\n", "above": "Force unit: {}\nTime (s),Position (mm),Force\n",
}  # fmt: skip
WAY_HEADS = {
    "in brackets": "Time (s),Position ({}),Force (N)\n", "behind": "Time_s,Position_{},Force_N\n",
    "in a row": "Time,Position,Force\ns,{},N\n", "above": "Length units,{}\nTime (s),Position,Force (N)\n",
}  # fmt: skip


def rows(mm: float = 1.0, newton: float = 1.0) -> str:
    return lines("{:.5f},{:.9g},{:.9g}", TIME_S, WAY_MM / mm, FORCE_N / newton)


def read(folder: Path) -> None:
    """By the usual answer, where the unit stands above the table."""
    answers = [question.usual for question in propose(folder).questions]
    assert all(answers)
    check(came_in(folder, *answers), abs_N=2e-3, abs_mm=2e-3)


@pytest.mark.parametrize("place", FORCE_HEADS)
@pytest.mark.parametrize("unit", FORCES)
def test_a_force_is_read_in_its_unit_wherever_that_stands(folder: Path, unit: str, place: str) -> None:
    text(FORCE_HEADS[place].format(unit), rows(newton=FORCES[unit]))(folder)
    read(folder)


@pytest.mark.parametrize("place", WAY_HEADS)
@pytest.mark.parametrize("unit", LENGTHS)
def test_a_way_is_read_in_its_unit_wherever_that_stands(folder: Path, unit: str, place: str) -> None:
    text(WAY_HEADS[place].format(unit), rows(mm=LENGTHS[unit]))(folder)
    read(folder)


@pytest.mark.parametrize(
    ("head", "unit"),
    [
        ("Time (s),Position (µ),Force (N)\n", "u"),
        ("Time (s),Position (NM),Force (N)\n", "NM"),
        ("Time (s),Position (mm),Force (poundal)\n", "poundal"),
        ("Force unit: poundal\nTime (s),Position (mm),Force\n", ""),
        ("Length units,furlongs\nTime (s),Position,Force (N)\n", ""),
    ],
)
def test_a_unit_that_stands_there_and_is_not_known_is_never_the_usual_one(folder: Path, head: str, unit: str) -> None:
    text(head, rows())(folder)
    (question,) = propose(folder).questions
    assert question.usual == ""
    assert unit in question.text


@pytest.mark.parametrize(
    ("head", "unit"), [("velocity_mm_s", "mm/s"), ("speed mm per min", "mm/min"), ("Weg in mm", "mm")]
)
def test_a_unit_by_another_is_one_unit(head: str, unit: str) -> None:
    assert unit_of(head) == unit


@pytest.mark.parametrize("other", ["stiffness_N_mm", "damping_N_s_mm", "speed_mm_s"])
def test_what_ends_in_a_unit_by_another_is_neither_time_nor_way_nor_force(folder: Path, other: str) -> None:
    text(f"{other},time_s,force_N,way_mm\n", lines("{:.5f},{:.3f},{:.5f},{:.5f}", TIME_S, TIME_S, FORCE_N, WAY_MM))(
        folder
    )
    read(folder)


def test_raw_counts_are_asked_unless_their_unit_stands_above(folder: Path) -> None:
    micro = lines("{:.5f},{:.5f},{:.0f}", TIME_S, WAY_MM, np.round(FORCE_N * 1e6))
    text("Time (s),Position (mm),Force\n", micro)(folder)
    assert [question.usual for question in propose(folder).questions] == [""]
