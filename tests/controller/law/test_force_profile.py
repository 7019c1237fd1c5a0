"""What a reference is at a time, and what is asked for so that the axis is there in time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.law.force_profile import Line, along, at, preview

SINE = Line(tuple(np.linspace(0, 0.2, 201)), tuple(2 + np.sin(10 * np.pi * np.linspace(0, 0.2, 201))), repeats=5)
STAIRS = Line((0.0, 1.0, 1.0, 2.0, 2.0, 3.0), (1.0, 1.0, 4.0, 4.0, 2.0, 2.0))


@pytest.mark.parametrize(("elapsed_s", "force_N"), [(0.0, 1.0), (0.999, 1.0), (1.0, 4.0), (2.5, 2.0), (9.0, 2.0)])
def test_a_jump_happens_at_its_time(elapsed_s: float, force_N: float) -> None:
    assert at(STAIRS, elapsed_s) == force_N


@given(st.lists(st.floats(0, 3.5), min_size=1, max_size=20), st.integers(1, 3))
def test_all_times_at_once_are_the_times_one_by_one(times_s: list[float], repeats: int) -> None:
    line = STAIRS._replace(repeats=repeats)
    np.testing.assert_array_equal(along(line, np.array(times_s)), [at(line, time_s) for time_s in times_s])


@given(st.floats(0, 0.985), st.floats(0.001, 0.015))
def test_a_smooth_reference_is_asked_for_early_also_across_its_repeats(elapsed_s: float, preview_s: float) -> None:
    assert at(preview(SINE, preview_s), elapsed_s) == pytest.approx(at(SINE, elapsed_s + preview_s), abs=1e-9)


def test_its_end_is_not_passed() -> None:
    assert at(preview(SINE._replace(repeats=1), 0.01), 0.195) == pytest.approx(2.0)


@given(st.floats(0, 3), st.floats(0.001, 2.0))
def test_a_jump_is_never_anticipated(elapsed_s: float, preview_s: float) -> None:
    assert at(preview(STAIRS, preview_s), elapsed_s) == at(STAIRS, elapsed_s)


def test_a_ramp_towards_a_jump_ends_where_the_jump_begins() -> None:
    ramp = Line((0.0, 1.0, 1.0, 2.0), (0.0, 1.0, 3.0, 3.0))
    early = preview(ramp, 0.1)
    assert [at(early, t) for t in (0.0, 0.5, 0.95, 1.0)] == pytest.approx([0.1, 0.6, 1.0, 3.0])
