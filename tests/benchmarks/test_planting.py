"""Operators on measured strokes, against strokes whose law is known: what would have been measured, computed twice."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.campaigns.operators import CYCLES, EXPONENT, LENGTH_MM, MOTION_HZ, OPERATORS, PITCH_MM, plant
from rig.trials.trial import Trial, TrialSet

SURFACE_MM, DEEPEST_MM, SPEED_MM_S, STEP_S, ZERO_N = 3.0, 8.0, 5.0, 0.01, 0.7
Column = NDArray[np.float64]
Moved = Callable[[Column, Column], Column]
TOP_N = 0.3 * (DEEPEST_MM - SURFACE_MM) ** 1.5


def law(place_mm: Column) -> Column:
    return np.asarray(ZERO_N + 0.3 * np.maximum(place_mm - SURFACE_MM, 0.0) ** 1.5)


def stroke(begin_s: float = 0.0) -> Trial:
    """In, hold, out; what is measured on the way out is nine tenths of the law."""
    time_s = np.arange(0, 4.4, STEP_S)
    place_mm = np.interp(time_s, [0.2, 1.8, 2.6, 4.2], [0.0, DEEPEST_MM, DEEPEST_MM, 0.0])
    out = time_s > 2.6
    force_N = law(place_mm) - 0.1 * out * (law(place_mm) - ZERO_N)
    return Trial("", time_s + begin_s, force_N, time_s + begin_s, place_mm)


def planted(cause: str, size: float, count: int = 1) -> list[Trial]:
    session = TrialSet("", tuple(stroke(10.0 * k) for k in range(count)))
    return list(plant(session, cause, size).trials)


def ways(trial: Trial) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """On the way in and out, away from corners and contact."""
    place_mm, time_s = trial.axis_mm, trial.axis_s - trial.axis_s[0]
    inside = (place_mm > SURFACE_MM + 0.5) & (place_mm < DEEPEST_MM - 1.0)
    return inside & (time_s < 1.8), inside & (time_s > 2.6)


@pytest.mark.parametrize(
    ("cause", "size", "moved_in", "moved_out"),
    [
        ("backlash", 0.4, lambda x, _: 0 * x, lambda x, _: 0.4 + 0 * x),
        ("position_ripple", 0.1, *[lambda x, _: 0.1 * np.sin(2 * np.pi * x / PITCH_MM + 0.7)] * 2),
        ("surface_motion", 0.2, *[lambda _, t: -0.2 * np.sin(2 * np.pi * MOTION_HZ * t + 0.7)] * 2),
    ],
)
def test_where_the_tip_would_have_been_elsewhere_force_is_that_of_the_law_there(
    cause: str, size: float, moved_in: Moved, moved_out: Moved
) -> None:
    (trial,) = planted(cause, size)
    into, out = ways(trial)
    place_mm, time_s = trial.axis_mm, trial.axis_s
    expected_in = law(place_mm + moved_in(place_mm, time_s))
    expected_out = ZERO_N + 0.9 * (law(place_mm + moved_out(place_mm, time_s)) - ZERO_N)
    assert trial.force_N[into] == pytest.approx(expected_in[into], abs=0.01 * TOP_N)
    assert trial.force_N[out] == pytest.approx(
        expected_out[out], abs=0.015 * TOP_N
    )  # a curve goes on straight at its ends
    assert trial.force_N[trial.axis_mm < SURFACE_MM - 0.5] == pytest.approx(ZERO_N, abs=1e-3)


def test_a_ripple_is_planted_in_few_samples_too() -> None:
    """A testing machine at 10 Hz: 36 samples on the way in, of which the curve of force has 18 places."""
    time_s = np.arange(36) / 10
    place_mm = DEEPEST_MM * time_s / time_s[-1]
    whole = TrialSet("", (Trial("", time_s, law(place_mm), time_s, place_mm),))
    (trial,) = plant(whole, "position_ripple", 0.1).trials
    inside = (place_mm > SURFACE_MM + 0.8) & (place_mm < DEEPEST_MM - 0.8)
    expected = law(place_mm + 0.1 * np.sin(2 * np.pi * place_mm / PITCH_MM + 0.7))
    assert trial.force_N[inside] == pytest.approx(expected[inside], abs=0.01 * TOP_N)
    assert float(np.ptp(trial.force_N[inside] - law(place_mm)[inside])) > 0.03 * TOP_N


def test_a_frame_gives_way_in_proportion_to_force() -> None:
    (trial,) = planted("frame_compliance", 0.02)
    into, _ = ways(trial)
    place_mm = trial.axis_mm[into]
    expected = law(place_mm - 0.02 * (law(place_mm) - ZERO_N))
    assert trial.force_N[into] == pytest.approx(expected, abs=0.01 * TOP_N)


def test_magnets_pull_in_the_air_too_twice_a_pitch() -> None:
    (trial,) = planted("cogging", 0.1)
    turn = 2 * np.pi * trial.axis_mm / PITCH_MM + 0.7
    expected = 0.1 * np.sin(turn) + 0.03 * np.sin(2 * turn + 1.0)
    assert trial.force_N - stroke().force_N == pytest.approx(expected)


def test_friction_begins_pushed_back_and_turns_over_its_length() -> None:
    (trial,) = planted("friction", 0.3)
    added = trial.force_N - stroke().force_N
    assert added[0] == pytest.approx(-0.3)
    way = trial.axis_mm[: np.argmax(trial.axis_mm)]
    assert added[: len(way)] == pytest.approx(0.3 * (1 - 2 * np.exp(-(way - way[0]) / LENGTH_MM)))
    assert added[-1] == pytest.approx(-0.3)


def test_causes_of_time_and_of_the_reading() -> None:
    (late,) = planted("time_offset", 0.013)
    assert late.force_s == pytest.approx(stroke().force_s + 0.013) and late.axis_s == pytest.approx(stroke().axis_s)
    (slow,) = planted("filter_lag", 0.05)
    hold = np.searchsorted(slow.force_s, 1.8)
    sharp = stroke().force_N
    rest = sharp[hold + 20] - slow.force_N[hold + 1 : hold + 20]
    assert rest[5] / rest[0] == pytest.approx(np.exp(-5 * STEP_S / 0.05), rel=1e-6)
    first, *_, last = planted("zero_drift", 36.0, 4)
    middle_s = 0.5 * (first.force_s[0] + last.force_s[-1])
    assert first.force_N - sharp == pytest.approx(0.01 * (first.force_s - middle_s))
    assert last.force_N - sharp == pytest.approx(0.01 * (last.force_s - middle_s))


def test_the_first_cycles_are_stiffer_and_their_zero_is_not() -> None:
    sharp = stroke().force_N
    for number, trial in enumerate(planted("preconditioning", 0.3, 3)):
        gain = 1 + 0.3 * np.exp(-number / CYCLES)
        assert trial.force_N - ZERO_N == pytest.approx(gain * (sharp - ZERO_N))


def test_a_drag_goes_with_a_power_of_speed_in_contact() -> None:
    (trial,) = planted("rate_law", 0.2)
    into, out = (way & (trial.axis_mm > SURFACE_MM + 1.0) for way in ways(trial))
    added = trial.force_N - stroke().force_N
    expected = 0.2 * (SPEED_MM_S / 10) ** EXPONENT
    assert added[into] == pytest.approx(expected, rel=0.01) and added[out] == pytest.approx(-expected, rel=0.01)
    assert added[trial.axis_mm < SURFACE_MM] == pytest.approx(0.0)


def test_every_operator_changes_a_stroke_by_its_usual_size() -> None:
    for cause, operator in OPERATORS.items():
        (trial,) = planted(cause, operator.usual)
        late = np.interp(stroke().force_s, trial.force_s, trial.force_N)
        # A zero that drifts by 10 N an hour moves by 6 mN in this one stroke.
        assert np.max(np.abs(late - stroke().force_N)) > (0.005 if cause == "zero_drift" else 0.02)
