"""The pictures of a diagnosis mark what its verdict says, and nothing else."""

from dataclasses import replace

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.estimates import ErrorGain, NamedCause
from rig.diagnosis.lack_of_fit import LackOfFit
from rig.report.diagnosis_figures import offending

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
    assert offending(FOUND) == {"velocity": "  <- depended on it"}


def test_a_cause_seen_elsewhere_marks_no_variable_of_the_force() -> None:
    assert offending(replace(FOUND, after=BEFORE)) == {}


def test_what_is_still_left_is_marked_also_where_another_variable_told_more_before() -> None:
    left = replace(FOUND, verdict="unexplained", depends_on=("depth",))
    assert offending(left) == {"depth": "  <- still depends on it"}


def test_a_simulation_that_is_adequate_has_no_mark() -> None:
    assert offending(replace(FOUND, verdict="adequate", findings=(), after=BEFORE)) == {}
