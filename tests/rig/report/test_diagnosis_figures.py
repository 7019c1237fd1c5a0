"""The pictures of a diagnosis show and mark what its answer says, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.estimates import ErrorBudget, ErrorGain, Estimate, NamedCause
from rig.diagnosis.lack_of_fit import LackOfFit
from rig.diagnosis.noise import Array
from rig.diagnosis.search import SearchStep
from rig.report.diagnosis_figures import (
    Compared,
    binned,
    headline,
    offending,
    plain_unit,
    power_shares,
    telling_recording,
)
from rig.report.evidence_figures import evidence_figure, outcome

BEFORE = LackOfFit({"velocity": 300.0, "depth": 80.0}, {}, 0.002)
AFTER = LackOfFit({"velocity": 1.0, "depth": 75.0}, {}, 0.4)
NAMED = NamedCause(
    ("friction",), "the guide has friction", 0.99, {}, ErrorGain(0.07, 0.01, 0.85, 0.8, 0.9), 900.0, 0.002, "", False
)
FOUND = Diagnosis(
    session="s", simulation="index", recordings=10, verdict="explained", statement="", findings=(NAMED,), depends_on=(),
    lack_of_fit_p=0.4, detectable={}, not_testable={}, next_experiment=None, quality=(), before=BEFORE, after=AFTER,
)  # fmt: skip


def test_what_a_cause_took_away_is_marked() -> None:
    assert offending(FOUND) == {"velocity": ": taken away"}


def test_a_cause_seen_elsewhere_marks_no_variable_of_the_force() -> None:
    assert offending(replace(FOUND, after=BEFORE)) == {}


def test_what_is_still_left_is_marked_also_where_another_variable_told_more_before() -> None:
    left = replace(FOUND, verdict="unexplained", depends_on=("depth",))
    assert offending(left) == {"depth": ": still left"}


def test_a_simulation_that_is_adequate_has_no_mark() -> None:
    assert offending(replace(FOUND, verdict="adequate", findings=(), after=BEFORE)) == {}


def errors_of(before: Array, after: Array, recordings: int) -> Compared:
    recording = np.repeat(np.arange(recordings), len(before) // recordings)
    return Compared(before, after, np.ones(len(before), bool), recording, "N")


def test_the_recording_shown_is_never_the_first_and_gains_or_misses_most() -> None:
    before, after = np.repeat([9.0, 2.0, 5.0, 5.0], 10), np.repeat([0.0, 1.0, 4.9, 1.0], 10)
    errors = errors_of(before, after, 4)
    assert telling_recording(errors, named=True) == 3
    assert telling_recording(errors, named=False) == 2
    assert telling_recording(errors_of(before[:10], after[:10], 1), named=True) == 0


def test_rows_that_are_not_judged_choose_no_recording() -> None:
    errors = errors_of(np.repeat([1.0, 9.0, 2.0], 10), np.zeros(30), 3)
    assert telling_recording(errors._replace(judged=errors.recording != 1), named=True) == 2


def test_a_band_counts_recordings_and_not_their_samples() -> None:
    """Means of four recordings are 1, 2, 3 and 4: 2.5 +- 2 sqrt(5/3 / 4), however many samples each has."""
    error = np.repeat([1.0, 2.0, 3.0, 4.0], 500)
    place, mean, half = binned(np.tile(np.linspace(0, 1, 500), 4), error, np.repeat(np.arange(4), 500))
    assert mean == pytest.approx(np.full(len(mean), 2.5))
    assert half == pytest.approx(np.full(len(half), 2 * np.sqrt(5 / 12)))
    assert len(place) > 20 and (np.diff(place) > 0).all()


def test_a_hold_is_no_spike_of_many_slim_bins() -> None:
    values = np.concatenate([np.linspace(0, 1, 100), 1 + 1e-4 * np.arange(1000), np.linspace(1.2, 2, 100)])
    place, _, _ = binned(values, np.zeros(1200), np.zeros(1200, int))
    assert 1 <= np.count_nonzero((place > 0.99) & (place < 1.11)) <= 3


def test_the_bar_shares_out_the_whole_error() -> None:
    budget = ErrorBudget(0.05, 0.03, 0.02, 0.02, 0.01, 0.02, None, None, {})
    found = power_shares(budget)
    # of 25: 1 is noise, 4 - 1 differ between repeats, 25 - 9 are explained, 9 - 4 are left
    assert list(found.values()) == pytest.approx([0.04, 0.12, 0.64, 0.20])


def test_the_bar_holds_no_more_noise_than_there_is_error() -> None:
    found = power_shares(ErrorBudget(0.06, 0.03, 0.03, 0.03, 0.058, 0.07, None, None, {}))
    # of 36: what is left, 9, is all noise
    assert list(found.values()) == pytest.approx([0.25, 0.0, 0.75, 0.0])


@pytest.mark.parametrize(
    ("unit", "means"),
    [("9.3 N", (9.3, "N")), ("mm", (1.0, "mm")), ("1/mm", (1.0, "1/mm")), ("0.2 rad/s", (0.2, "rad/s"))],
)
def test_a_unit_that_stands_for_several_is_told_in_the_plain_one(unit: str, means: tuple[float, str]) -> None:
    assert plain_unit(unit) == means


def test_the_title_says_cause_size_and_gain_or_that_there_is_none() -> None:
    errors = errors_of(np.full(10, 0.07), np.full(10, -0.01), 2)
    size = {"friction_N": Estimate(0.1, 0.09, 0.11, unit="N")}
    sized = replace(NAMED, effects=("friction", "tip_inertia"), parameters=size)
    said = headline(replace(FOUND, findings=(sized,)), errors)
    gain = "error 0.07 -> 0.01 N, 86 % less"
    assert said == f"friction or tip inertia 0.1 N (0.09 to 0.11)\n{gain}"
    likely = headline(replace(FOUND, findings=(replace(sized, provisional=True),)), errors)
    assert likely.startswith("Provisionally: friction")
    assert headline(replace(FOUND, findings=()), errors).startswith("No cause can be named")


def test_each_step_shows_what_it_tried_and_took() -> None:
    first = SearchStep({"friction": 300.0, "backlash": 90.0, "drift": -2.0}, 6.0, "friction")
    panels = evidence_figure([first, SearchStep({"drift": 3.0}, 6.0, None)], ["friction"]).axes
    titles = [axes.get_title(loc="left") for axes in panels]
    assert titles == ["Step 1: friction is taken", "Step 2: nothing more is named"]
    bars = [[text.get_text() for text in axes.get_yticklabels()] for axes in panels]
    assert bars == [["backlash", "friction"], ["drift"]]
    assert outcome(first, []) == "friction is taken, and given up later"
