"""Share, floor and cost of every planted cause agree with the line of evidence, which knows no terms of recordings."""

from dataclasses import asdict, replace

import pytest

from rig.diagnosis.answers import gain_of
from rig.diagnosis.estimates import ErrorGain
from rig.diagnosis.floor import WORTH_EXPLAINING, error_budget
from tests.rig.diagnosis.test_planted_sizes import PLANTED, best
from tests.rig.results.test_diagnosis_lines import FRICTION, lines, result

# Own terms of recordings, were they fitted again without the cause, would take up all of these.
BETWEEN = ("preconditioning_gain", "temperature_per_K", "contact_offset_mm", "zero_drift_N_h")
# The place of the tip tells them: the force hardly does.
OF_TRACKER = {"frame_compliance_mm_N", "tracker_latency_s"}


@pytest.mark.parametrize(
    "key", [*BETWEEN, *(pytest.param(key, marks=pytest.mark.campaign) for key in PLANTED if key not in BETWEEN)]
)
def test_share_floor_and_cost_agree_with_the_evidence(key: str) -> None:
    first, model = best(key)
    budget, gain = error_budget(first, model), gain_of(first, model)
    # Terms of its own spare each recording some of the noise: three of them, of hundreds of rows.
    assert budget.base_N == pytest.approx(gain.rmse_before_N, rel=0.1)
    assert budget.extended_N == pytest.approx(gain.rmse_after_N, rel=0.15)
    assert budget.floor_N <= budget.extended_N < 1.1 * budget.floor_N
    said = lines(result("explained", replace(FRICTION, gain=gain), **asdict(budget)))
    if key in OF_TRACKER:
        assert budget.base_N < 1.3 * budget.extended_N
        return
    assert budget.explained_share is not None and budget.explained_share.low > 0.9
    assert said["explained"].startswith(("100 %", "99 %", "98 %"))
    wrong_N = (gain.rmse_before_N**2 - gain.rmse_after_N**2) ** 0.5
    told_N = float(said["cost"].removeprefix("a model without it gets the force wrong by ").partition(" N")[0])
    assert told_N == pytest.approx(wrong_N, rel=0.1)


def test_a_cause_that_force_does_not_show_is_told_so() -> None:
    gain = ErrorGain(0.003, 0.003, 0.0, -0.01, 0.01)
    same = {"base_N": 0.003, "extended_N": 0.003, "floor_N": 0.003 / WORTH_EXPLAINING, "explained_share": None}
    said = lines(result("explained", replace(FRICTION, gain=gain), **same))
    assert said["explained"].startswith("what is named takes little off the error of force, which goes from 0.003 to")
    assert said["cost"] == "none in force: a model without it predicts that as well"
