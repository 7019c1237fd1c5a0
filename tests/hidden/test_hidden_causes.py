"""A cause is hidden by another program; the diagnosis sees only the data and must name it, size it and gain by it.

The seeds draw the cause, its size and the whole session. Those written here were fixed before any of them was run and
none was exchanged since; each run draws others beside them and prints its seed (``TISSUE_RIG_SEED``). How often such
sessions are answered rightly is counted by ``benchmarks.criticism --campaign hidden``.
"""

import numpy as np
import pytest

from benchmarks.campaigns.case import Answer, Named
from benchmarks.campaigns.engine import answer
from benchmarks.campaigns.hidden import HIDDEN, KINDS, record
from benchmarks.hidden.draw import UNKNOWN, Secret, draw_secret, recorded, session_of
from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.observations import observe
from rig.diagnosis.run import diagnose
from tests.hidden.promises import contradicted, of_kind

STROKES = 10
pytestmark = pytest.mark.timeout(120)  # a diagnosis takes 2 to 10 s of a core
# What each drew when it was fixed: the library has grown since.
DRAWN = {
    501: "friction", 503: "time_offset", 504: "frame_compliance", 505: "adhesion", 9001: "contact_offset",
    9002: "relaxation", 9003: "backlash", 9004: "substrate",
}  # fmt: skip
# The quickest of the tissue in every run of `make test`; the machine's and the stated conditions' are in the campaigns.
FIRST = (9002,)
SEEDS = [seed if seed in FIRST else pytest.param(seed, marks=pytest.mark.campaign) for seed in DRAWN]
SEEN_BY_TRACKER_ONLY = {"frame_compliance", "tracker_latency"}


def secret_of(seed: int) -> Secret:
    """The cause a seed drew."""
    return draw_secret(np.random.default_rng([seed, 5]), DRAWN[seed])


def judged(seed: int, secret: Secret) -> Diagnosis:
    """Diagnosis of one session."""
    bench, made = recorded(seed, secret, STROKES)
    return diagnose(observe(session_of(bench, made, stated=secret.name == "contact_offset")))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_hidden_cause_is_named_with_its_size_inside_the_interval_and_a_gain(seed: int) -> None:
    secret = secret_of(seed)
    result = judged(seed, secret)
    assert result.verdict == "explained", result.statement
    found = result.findings[0]
    assert secret.name in found.effects
    assert found.evidence_nats > 0
    assert found.p_value < 0.05
    for parameter, truth in secret.expected.items():
        interval = found.parameters[parameter]
        assert interval.low <= truth <= interval.high, (parameter, truth, interval)
    # What shows on the tracker only cannot gain on the force.
    assert secret.name in SEEN_BY_TRACKER_ONLY or found.gain.reduction > 0.02


# The first takes a minute, as long as all hidden causes together.
@pytest.mark.parametrize(
    ("seed", "name"),
    [
        pytest.param(seed, name, marks=pytest.mark.campaign if rank else pytest.mark.by_hand)
        for rank, (seed, name) in enumerate(zip((9101, 9102, 9103), UNKNOWN, strict=True))
    ],
)
def test_what_the_library_does_not_hold_is_called_unexplained_with_the_variable_it_depends_on(
    seed: int, name: str
) -> None:
    result = judged(seed, draw_secret(np.random.default_rng([seed, 5]), name))
    assert result.verdict == "unexplained", result.statement
    assert set(result.depends_on) & set(UNKNOWN[name])
    assert all(finding.provisional for finding in result.findings)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [601, 602])
def test_a_clean_session_is_adequate_and_says_what_it_would_have_shown(seed: int) -> None:
    result = judged(seed, Secret("none", {}, {}))
    assert result.verdict == "adequate", result.statement
    assert result.findings == ()
    assert {"friction", "backlash", "relaxation", "time_offset"} <= result.detectable.keys()
    assert result.not_testable["gain_error"].endswith("hang a known weight")
    assert "contact_offset" in result.not_testable


@pytest.mark.campaign
def test_stiffening_comes_out_by_itself_where_constant_stiffness_is_simulated() -> None:
    """The study's own discovery."""
    bench, made = recorded(603, draw_secret(np.random.default_rng(5), "none"), 6)
    result = diagnose(observe(session_of(bench, made)), "constant")
    assert result.findings[0].effects[0] == "stiffening", result.statement
    assert result.findings[0].gain.reduction > 0.5


@pytest.mark.campaign
@pytest.mark.timeout(300)
def test_causes_that_nobody_has_seen_do_not_contradict_what_is_promised() -> None:
    """Seeds of this run alone: that all three are answered wrongly comes by chance once in eight thousand runs."""
    first = of_kind("one cause", KINDS)
    records = [record(first + k * len(KINDS), answer) for k in range(3)]
    assert not contradicted(HIDDEN, records), [one.line for one in records]


def test_an_engine_that_finds_nothing_true_contradicts_it() -> None:
    wrong = Answer("explained", (Named(("gain_error",), True, 1.0),))
    first = of_kind("one cause", KINDS)
    records = [record(first + k * len(KINDS), lambda _: wrong) for k in range(3)]
    assert len(contradicted(HIDDEN, records)) >= 2
