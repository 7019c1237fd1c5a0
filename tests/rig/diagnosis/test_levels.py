"""Own terms that go with an operator are no chance; those that go with a specimen are nature."""

from dataclasses import replace

import numpy as np
import pytest

from rig.diagnosis.levels import label_dependence
from rig.diagnosis.observations import observe
from rig.diagnosis.run import diagnose_session
from rig.trials.trial import Trial, TrialSet
from tests.rig.diagnosis.made_tissue import MadeTissue

COUNT = 12
OPERATORS = ("ann", "bob", "cid") * 4
LEVEL = np.stack([np.eye(COUNT) - 1 / COUNT] * 3)


def shifts(seed: int, gap: float = 0.0) -> np.ndarray:
    """Stiffness, contact and zero of each recording; Bob's stiffness is higher by ``gap`` standard deviations."""
    rows = np.random.default_rng(seed).standard_normal((COUNT, 3))
    rows[:, 0] += gap * (np.array(OPERATORS) == "bob")
    return rows


def test_what_goes_with_an_operator_is_found_and_by_its_name() -> None:
    labels = {"operator": OPERATORS, "cycle": ("1", "2") * 6}
    found = label_dependence(shifts(1, 8.0), LEVEL, labels)
    assert found.label == "operator" and found.p_value < 1e-3
    assert label_dependence(shifts(1, 8.0), LEVEL, {"specimen": OPERATORS}) == (None, 1.0)


def test_chance_is_as_rare_as_it_is_said_to_be() -> None:
    # Bonferroni's bound over three independent quantities is nearly exact.
    chances = np.array([label_dependence(shifts(seed), LEVEL, {"operator": OPERATORS}).p_value for seed in range(400)])
    assert np.mean(chances < 0.05) == pytest.approx(0.05, abs=0.033)  # three standard errors of 400 draws


def test_what_is_explained_already_is_taken_off() -> None:
    bob = (np.array(OPERATORS) == "bob") - 1 / 3
    beside = LEVEL - np.outer(bob, bob) / (bob @ bob)
    assert label_dependence(shifts(1, 8.0), beside, {"operator": OPERATORS}).p_value > 0.05


def test_groups_of_one_say_nothing() -> None:
    labels = {"cycle": tuple(map(str, range(COUNT)))}
    assert label_dependence(shifts(1), LEVEL, labels).p_value == 1.0


def test_a_session_keeps_the_labels_that_differ_in_the_order_of_its_recordings() -> None:
    time_s = np.arange(0, 2, 0.004)
    place_mm = 10 + 5 * np.sin(np.pi * time_s / 2)
    force_N = np.maximum(place_mm - 12, 0) + np.random.default_rng(1).normal(0, 0.01, len(time_s))
    one = Trial("one", time_s, force_N, time_s, place_mm, labels={"operator": "ann", "site": "calf"})
    later = time_s + 10
    other = replace(one, name="other", force_s=later, axis_s=later, force_N=force_N + 0.001, labels={"site": "calf"})
    assert observe(TrialSet("made", (other, one))).labels == {"operator": ("ann", "")}


def test_sites_of_other_stiffness_are_no_error_of_a_right_simulation() -> None:
    """Without stiffness and contact of their own the recordings left out would be 41 % of the force's spread wrong."""
    rng = np.random.default_rng(1)
    stiffer, apart_mm = np.exp(0.5 * rng.standard_normal(8)), 0.2 * rng.standard_normal(8)
    sites = [MadeTissue(a_N_mm=0.2 * k, surface_off_mm=mm) for k, mm in zip(stiffer, apart_mm, strict=True)]
    found = diagnose_session(TrialSet("sites", tuple(site.session(seed=k).trials[k] for k, site in enumerate(sites))))
    assert (found.verdict, found.findings) == ("adequate", ())
    assert found.budget is not None
    assert found.budget.scatter["stiffness"].sd == pytest.approx(np.std(np.log(stiffer), ddof=1), rel=0.1)
    assert found.budget.scatter["touch"].sd == pytest.approx(np.std(apart_mm, ddof=1), rel=0.1)
