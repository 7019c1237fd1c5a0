"""A protocol that presses harder than its subject bears is run with a force limit that they bear."""

import pytest

from controller.experiments.capture import check
from rig.config.protocol import Indentation
from rig.config.wiring import Wiring
from rig.errors import UsageError

PROTOCOL = Indentation(speeds_mm_s=(10.0,), force_limit_N=12.0)


def bearing(pain_threshold_N: float, limit_N: float = 25.0) -> Wiring:
    return Wiring.model_validate({"subject": {"pain_threshold_N": pain_threshold_N}, "limits": {"force_N": limit_N}})


@pytest.mark.parametrize(("threshold_N", "limit_N"), [(15.0, 12.0), (12.0, 12.0), (11.0, 8.8), (4.0, 3.2)])
def test_its_compressions_end_at_four_fifths_of_the_threshold_or_at_its_own_limit(
    threshold_N: float, limit_N: float
) -> None:
    assert check(PROTOCOL, bearing(threshold_N)).force_limit_N == pytest.approx(limit_N)


def test_the_threshold_of_the_site_counts_where_it_is_lower() -> None:
    subject = {"pain_threshold_N": 15.0, "site": "left forearm", "site_thresholds_N": {"left forearm": 5.0}}
    assert check(PROTOCOL, Wiring.model_validate({"subject": subject})).force_limit_N == pytest.approx(4.0)


def test_what_the_bench_may_not_do_is_refused_as_before() -> None:
    with pytest.raises(UsageError, match="force_limit_N 12 N is above the force limit, 10 N"):
        check(PROTOCOL, bearing(15.0, limit_N=10.0))
