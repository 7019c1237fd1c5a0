"""A name needs evidence beyond its standard error, and less error on recordings left out: one is not the other."""

import numpy as np
import pytest

from rig.diagnosis.effects.registry import CAUSES
from rig.diagnosis.support import Support, pooled_log_ratio


def support(nats: float, spread: float, log_error: float, error_spread: float, count: int = 12) -> Support:
    """A gain and a fall of the error by recording, half of them ``spread`` above their mean and half below."""
    sides = np.resize([1.0, -1.0], count)
    return Support(nats / count + spread * sides, log_error + error_spread * sides)


@pytest.mark.parametrize(
    ("found", "holds"),
    [
        (support(50, 1, 0.1, 0.05), True),
        (support(100_000, 1, 0.0, 0.001), False),  # friction of 571 nats beside an error that does not fall
        (support(100_000, 1, -0.2, 0.05), False),  # a drift that predicts recordings worse
        (support(5.9, 0.01, 0.1, 0.01), False),
        (support(6.1, 0.01, 0.1, 0.01), True),
        (support(50, 8, 0.1, 0.05), False),  # 50 +- 29 nats
        (support(50, 1, 0.019, 0.001), False),
        (support(50, 1, 0.05, 0.2), False),  # 5 +- 6 %
    ],
)
def test_a_name_needs_evidence_and_less_error_each_beyond_its_uncertainty(found: Support, holds: bool) -> None:
    assert found.holds is holds


def test_the_standard_error_is_that_of_a_sum_over_recordings() -> None:
    assert Support(np.array([1.0, 3.0, 5.0, 7.0]), np.zeros(4)).standard_error_nats == pytest.approx(
        2 * np.sqrt(20 / 3)
    )


def test_few_recordings_need_more_by_students_t() -> None:
    # The sum is 2.5 standard errors: beyond 2, and below 3.18 for four recordings.
    for count, holds in ((12, True), (4, False)):
        sides = np.resize([1.0, -1.0], count)
        nats = 5 + sides * 5 * np.sqrt(count - 1) / 2.5
        assert Support(nats, 0.5 + 0.01 * sides).holds is holds


def test_what_a_tissue_could_do_is_not_of_the_bench() -> None:
    of_bench = {cause.name for cause in CAUSES.values() if cause.is_of_bench}
    assert of_bench == {
        "backlash", "position_ripple", "surface_motion", "friction", "tip_inertia", "filter_lag", "time_offset",
        "gain_error", "adhesion", "sensor_hysteresis", "clock_drift", "surface_motion_harmonic", "cogging",
        "cross_talk",
    }  # fmt: skip


def test_what_lies_in_three_of_twelve_recordings_lowers_the_error_of_all() -> None:
    old, new = np.full(12, 1.0), np.full(12, 1.0)
    old[:3] = 9.0
    found = pooled_log_ratio(old, new)
    # The mean of pseudo-values is the ratio less its bias, which is of the order of 1 / 12.
    assert found.mean() == pytest.approx(np.log(36 / 12), abs=0.1)
    assert Support(np.full(12, 2.0), found).holds
    by_recording = Support(np.full(12, 2.0), np.log(old / new))
    assert not by_recording.holds
    assert not Support(np.full(12, 2.0), pooled_log_ratio(new, old)).holds
