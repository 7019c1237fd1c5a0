"""A cause is hidden by another program; the diagnosis sees only the data and must name it, size it and gain by it."""

import numpy as np
import pytest

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.observations import observe
from rig.diagnosis.run import diagnose
from tests.hidden.draw import draw_secret, recorded, session_of

CAUSES = ("friction", "time_offset", "frame_compliance", "adhesion")


def judged(seed: int, name: str, strokes: int = 10) -> tuple[dict[str, float], Diagnosis]:
    """Truth and diagnosis of one session."""
    secret = draw_secret(np.random.default_rng([seed, 5]), name)
    bench, made = recorded(seed, secret, strokes)
    data = observe(session_of(bench, made, stated=name == "contact_offset"))
    return dict(secret.expected), diagnose(data)


@pytest.mark.parametrize(("seed", "name"), list(zip((501, 503, 504, 505), CAUSES, strict=True)))
def test_a_hidden_cause_is_in_the_answer_with_its_size_and_a_gain(seed: int, name: str) -> None:
    expected, result = judged(seed, name)
    assert result.verdict == "explained", result.statement
    found = result.findings[0]
    assert name in found.effects
    assert found.nats > 0
    assert found.p_value < 0.05
    for parameter, truth in expected.items():
        interval = found.parameters[parameter]
        # Another integrator and another noise: the interval, and a few percent beside it.
        slack = 0.05 * abs(truth)
        assert interval.low - slack <= truth <= interval.high + slack, (parameter, truth, interval)
    # What shows on the tracker only cannot gain on the force.
    assert name == "frame_compliance" or found.gain.reduction.value > 0.02


@pytest.mark.parametrize("seed", [601, 602])
def test_a_clean_session_is_adequate_and_says_what_it_would_have_shown(seed: int) -> None:
    _, result = judged(seed, "none")
    assert result.verdict == "adequate", result.statement
    assert result.findings == ()
    assert {"friction", "backlash", "relaxation", "time_offset"} <= result.detectable.keys()
    assert result.not_testable["gain_error"].endswith("hang a known weight")
    assert "contact_offset" in result.not_testable


def test_stiffening_comes_out_by_itself_where_constant_stiffness_is_simulated() -> None:
    """The study's own discovery."""
    bench, made = recorded(603, draw_secret(np.random.default_rng(5), "none"), 6)
    result = diagnose(observe(session_of(bench, made)), "constant")
    assert result.findings[0].effects[0] == "stiffening", result.statement
    assert result.findings[0].gain.reduction.value > 0.5
