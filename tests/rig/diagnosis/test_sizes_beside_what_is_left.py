"""A size named beside a residual that no cause explains: its interval counts what is left, and then holds the truth."""

import numpy as np
import pytest

from benchmarks.campaigns.engine import answer
from benchmarks.campaigns.forms import FORMS
from rig.diagnosis import answers
from rig.diagnosis.fit import Fit
from rig.diagnosis.noise import Array

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(300)]
# Friction beside a memory of the tissue that the library does not hold; their truths are in docs/validation.
SEEDS = pytest.mark.parametrize("seed", [97075, 97169])


def is_inside(seed: int) -> bool:
    record = FORMS.record(seed, answer)
    [(_, low, high)] = [one.sizes["friction_N"] for one in record.answer.named if "friction_N" in one.sizes]
    assert record.answer.verdict == "unexplained"
    return bool(low <= record.truth.sizes["friction_N"] <= high)


def nothing(fit: Fit, variable: Array) -> Array:
    return np.zeros((len(fit.free), len(fit.free)))


@SEEDS
def test_what_is_left_widens_an_interval_until_it_holds(seed: int) -> None:
    assert is_inside(seed)


def test_recordings_alone_do_not_know_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plant: each recording lacks the same cause, so that they agree with each other, and on what is wrong."""
    monkeypatch.setattr(answers, "jackknife_along", nothing)
    assert not is_inside(97075)
