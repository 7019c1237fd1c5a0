"""K and B for control: a row for each force that the law reaches, and none where it only falls."""

import math

import numpy as np
import pytest

from rig.tissue.control_table import reached
from rig.tissue.laws import FloatArray, Index, depth_rising
from rig.tissue.laws_extended import Extended

FORCES_N = np.array([0.5, 2.0, 4.0, 5.0, 6.0, 8.0])


SOFTENING = Extended(a_N_mm=0.63, b_per_mm=-0.046, damping_N_s_mm=0.0)
TOP_MM = 1 / 0.046  # where x exp(-0.046 x) is largest
LARGEST_N = 0.63 * TOP_MM / math.e  # 5.04


def test_a_law_that_softens_has_rows_up_to_its_largest_force() -> None:
    assert reached(SOFTENING, FORCES_N).tolist() == FORCES_N[FORCES_N < LARGEST_N].tolist()


def test_a_depth_is_on_the_part_that_rises_and_no_force_lies_beyond_it() -> None:
    depths_mm = np.array([0.0, 0.3, 5.0, 12.0, 21.0])
    assert SOFTENING.depth(SOFTENING.force(depths_mm)) == pytest.approx(depths_mm, abs=1e-6)
    assert SOFTENING.depth(2 * LARGEST_N) == pytest.approx(TOP_MM, abs=0.1)


def test_one_that_stiffens_has_all() -> None:
    assert reached(Index(a_N_mm=0.12, b_per_mm=0.22, damping_N_s_mm=0.01), FORCES_N).tolist() == FORCES_N.tolist()


def test_any_force_that_falls_beyond_its_top_is_turned_round_before_it() -> None:
    depths_mm = np.array([0.1, 2.0, 4.9])
    assert depth_rising(hump, hump(depths_mm), 30.0) == pytest.approx(depths_mm, abs=1e-6)
    assert depth_rising(hump, np.array([99.0]), 30.0) == pytest.approx([5.0], abs=0.02)


def hump(depth_mm: FloatArray) -> FloatArray:
    return np.asarray(depth_mm * np.exp(-depth_mm / 5.0))
