"""The five-speed comparison finds the damping that is there and none where there is none."""

import numpy as np
import pytest

from rig.errors import DataError
from rig.tissue.rates import rate_test
from rig.trials.contact import Contact
from rig.trials.curves import Curve

SPEEDS = (5.0, 10.0, 15.0, 20.0, 30.0)


def curve(speed: float, damping: float, scatter: float, number: int, subject: str = "", k_N_mm: float = 0.1) -> Curve:
    depth = np.linspace(0.0, 8.0, 300)
    force = (1.0 + scatter) * k_N_mm * depth * np.exp(0.2 * depth) + damping * speed
    contact = Contact(0.0, -0.05, 0.05, 0.01)
    return Curve(
        f"trial_{number}", speed, depth, force, np.full_like(depth, speed), contact, 0.0, 0.01, depth / speed, subject
    )


def five_by_five(damping: float) -> list[Curve]:
    generator = np.random.default_rng(4)
    return [
        curve(speed, damping, float(generator.normal(0.0, 0.03)), number) for number, speed in enumerate(SPEEDS * 5)
    ]


def test_damping_is_found_within_its_interval() -> None:
    found = rate_test(five_by_five(0.01))
    assert found.interval[0] < 0.01 < found.interval[1]
    assert found.p_value < 0.05
    assert found.excludes_study
    assert found.study_effect_N == pytest.approx(32.5)


def test_curves_that_agree_are_not_told_apart_and_still_exclude_the_study_s_value() -> None:
    found = rate_test(five_by_five(0.0))
    assert found.interval[0] < 0.0 < found.interval[1]
    assert found.p_value > 0.05
    assert found.excludes_study


def test_the_study_s_damping_would_be_seen_at_once() -> None:
    found = rate_test(five_by_five(1.3))
    assert not found.excludes_study
    assert found.effect_N == pytest.approx(32.5, rel=0.02)


def test_the_effect_is_given_in_newtons_with_its_interval() -> None:
    found = rate_test(five_by_five(0.01))
    low, high = found.effect_interval_N
    assert found.effect_N == pytest.approx(25.0 * found.damping_N_s_mm)
    assert low < 0.25 < high
    assert high - low == pytest.approx(25.0 * (found.interval[1] - found.interval[0]))


def test_a_subject_is_compared_with_itself() -> None:
    """A stiff subject measured fast and a soft one measured slowly are no damping."""
    soft = [curve(speed, 0.01, 0.0, number, "soft", 0.05) for number, speed in enumerate((5.0, 5.0, 5.0, 10.0))]
    stiff = [curve(speed, 0.01, 0.0, number, "stiff", 0.2) for number, speed in enumerate((20.0, 30.0, 30.0, 30.0))]
    assert rate_test([*soft, *stiff]).damping_N_s_mm == pytest.approx(0.01, abs=1e-9)


def test_the_share_of_shuffles_is_what_chance_gives() -> None:
    """Two trials a speed without scatter but one: no order of labels gives a larger slope."""
    curves = [curve(speed, 0.02, 0.0, number) for number, speed in enumerate((5.0, 5.0, 10.0, 10.0, 20.0, 20.0))]
    assert rate_test(curves).p_value == pytest.approx(2 * 8 / 720, abs=0.012)


def test_one_speed_is_not_a_comparison() -> None:
    with pytest.raises(DataError, match=r"6 trials at 1 speeds; the test needs 4 trials at 2 speeds or more"):
        rate_test([curve(5.0, 0.0, 0.0, number) for number in range(6)])
