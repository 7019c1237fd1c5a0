"""A drive axis: causes hidden in a made one by name and size, in any unit, and what cannot be judged."""

from dataclasses import replace

import numpy as np
import pytest

from rig.diagnosis.answers import Diagnosis, error_sources, intervals
from rig.diagnosis.axis_run import diagnose_axis
from rig.diagnosis.effects.axis import AXIS_CAUSES, AxisEffect
from rig.diagnosis.estimates import Estimate
from rig.errors import UsageError
from rig.intake.axis import AxisData, AxisRecording
from rig.intake.mapping import AxisFacts
from rig.results.diagnosis import DiagnosisResult
from tests.rig.diagnosis.made_axis import MadeAxis, counted, data_of

DRY = MadeAxis(coulomb_N=12.0)
# What is hidden beside dry friction, the cause that is to be named, its first parameter, its size, and how well.
HIDDEN = [
    (replace(DRY, viscous_forward=150.0, viscous_backward=150.0), "viscous_friction", "viscous", 150.0, 0.05),
    (replace(DRY, viscous_forward=120.0, viscous_backward=240.0), "asymmetric_friction", "asymmetry", -60.0, 0.05),
    (replace(DRY, static_N=8.0), "stribeck_friction", "stribeck", 8.0, 0.05),
    (replace(DRY, load_N_m=80.0), "position_load", "position_load", 80.0, 0.05),
    (replace(DRY, ripple_N=4.0), "position_ripple", "ripple", 4.0, 0.05),
    (replace(DRY, late_s=0.004), "dead_time", "dead_time", 0.004, 0.05),
    (replace(DRY, flexible=0.02, encoder_m=1e-10), "flexible_mode", "flexible", 0.02, 0.1),
    (replace(DRY, backlash_m=4e-4), "backlash", "backlash", 4e-4, 0.05),
    (replace(DRY, compliance_m_N=2e-6), "transmission_compliance", "compliance", 2e-6, 0.05),
]


def named(result: Diagnosis) -> dict[str, dict[str, float]]:
    """Sizes by cause, of those named first."""
    return {one.effects[0]: {name: e.value for name, e in one.parameters.items()} for one in result.findings}


def diagnosed(data: AxisData, facts: AxisFacts | None = None) -> Diagnosis:
    return diagnose_axis(data, "made", facts or AxisFacts())


@pytest.mark.parametrize(("axis", "cause", "parameter", "size", "within"), HIDDEN, ids=[row[1] for row in HIDDEN])
def test_a_hidden_cause_is_named_with_its_size_beside_the_bristles(
    axis: MadeAxis, cause: str, parameter: str, size: float, within: float
) -> None:
    found = diagnosed(data_of(axis.recording(sees_load=AXIS_CAUSES[cause].on_load)))
    sizes = named(found)
    assert sizes[cause][parameter] == pytest.approx(size, rel=within), found.statement
    assert sizes["coulomb_friction"]["coulomb"] == pytest.approx(12.0, rel=0.05)
    assert found.verdict == "explained", found.statement


def test_a_weight_on_a_joint_is_named_in_newton_metres() -> None:
    turning = counted(replace(DRY, weight_N=20.0).recording(), 1.0, 1.0)
    found = diagnosed(data_of(turning, position="rad", effort="N m"))
    causes = {name for one in found.findings for name in one.effects}
    assert "gravity" in causes
    assert "N m" in found.statement


def test_a_weight_on_a_joint_that_turns_by_half_a_turn_is_named_alone_with_its_size() -> None:
    """Over 20 degrees a sine is a line, which any load along the axis is too."""
    turning = counted(replace(DRY, weight_N=20.0, drift_m_s=0.3).recording(), 1.0, 1.0)
    found = diagnosed(data_of(turning, position="rad", effort="N m"))
    assert {one.effects for one in found.findings} == {("coulomb_friction",), ("gravity",)}
    assert named(found)["gravity"]["gravity"] == pytest.approx(20.0, rel=0.05)
    assert found.verdict == "explained", found.statement


def test_the_answer_is_the_same_in_any_unit() -> None:
    axis = replace(DRY, viscous_forward=120.0, viscous_backward=240.0)
    first = diagnosed(data_of(axis.recording()))
    for per_m, per_N, place, effort in ((1e3, 1.0, "mm", "N"), (4096.0, 0.02, "counts", "A"), (1e-3, 1e6, "km", "uN")):
        again = diagnosed(data_of(counted(axis.recording(), per_m, per_N), position=place, effort=effort))
        assert (again.verdict, list(named(again))) == (first.verdict, list(named(first)))
        size = named(first)["asymmetric_friction"]["asymmetry"] * per_N / per_m
        assert named(again)["asymmetric_friction"]["asymmetry"] == pytest.approx(size, rel=1e-3)
        assert named(again)["coulomb_friction"]["coulomb"] == pytest.approx(
            named(first)["coulomb_friction"]["coulomb"] * per_N, rel=1e-3
        )
        assert f" {effort} whatever its speed" in again.statement


def test_recordings_are_fitted_together() -> None:
    """Each moves one way only, and friction is then an offset; both together tell it."""
    ways = [replace(DRY, drift_m_s=drift).recording(name=name) for name, drift in (("in", 0.8), ("out", -0.8))]
    alone, together = diagnosed(data_of(ways[0])), diagnosed(data_of(*ways))
    assert "coulomb_friction" not in named(alone)
    assert alone.not_testable["coulomb_friction"] == "the axis moves one way only"
    assert named(together)["coulomb_friction"]["coulomb"] == pytest.approx(12.0, rel=0.05)


def test_an_axis_that_is_a_mass_has_nothing_named() -> None:
    found = diagnosed(data_of(MadeAxis().recording()))
    assert (found.verdict, found.findings) == ("adequate", ())
    assert found.base["inertia"].value == pytest.approx(50.0, rel=0.01)


def test_what_is_known_is_no_cause() -> None:
    axis = replace(DRY, viscous_forward=150.0, viscous_backward=150.0)
    found = diagnosed(data_of(axis.recording()), AxisFacts(known=("viscous_friction",)))
    assert list(named(found)) == ["coulomb_friction"]
    assert found.base["viscous"].value == pytest.approx(150.0, rel=0.05)


def test_friction_of_no_known_law_is_not_explained() -> None:
    recording = MadeAxis().recording()
    speed = np.gradient(recording.position, recording.time_s)
    odd = replace(recording, effort=recording.effort + 200 * speed * np.abs(speed))
    found = diagnosed(data_of(odd))
    assert found.verdict == "unexplained"
    assert all(one.provisional and one.confidence <= 0.2 for one in found.findings)


def test_a_model_that_leaves_a_third_of_the_effort_explains_nothing() -> None:
    recording = MadeAxis().recording()
    speed = np.gradient(recording.position, recording.time_s)
    found = diagnosed(data_of(replace(recording, effort=recording.effort + 40 * np.sin(speed / 0.04))))
    assert found.verdict == "unexplained"
    # What is left widens the intervals, as it does where a residual is not explained.
    assert found.search is not None
    after = found.search.after
    alone = intervals(after, after.problem.base, error_sources(after, is_left=False))
    assert all(share_of_value(found.base[name]) > share_of_value(one) for name, one in alone.items() if one.value)


def share_of_value(size: Estimate) -> float:
    assert size.low is not None and size.high is not None
    return abs((size.high - size.low) / size.value)


def test_gaps_and_samples_that_are_no_number_change_little() -> None:
    recording = DRY.recording()
    position, effort = recording.position.copy(), recording.effort.copy()
    position[700:720], effort[::97], effort[1500:1600] = np.nan, np.nan, np.nan
    found = diagnosed(data_of(replace(recording, position=position, effort=effort)))
    assert named(found)["coulomb_friction"]["coulomb"] == pytest.approx(12.0, rel=0.05)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda r: replace(r, effort=np.full_like(r.effort, 3.0)), "the effort never changes"),
        (lambda r: replace(r, position=np.full_like(r.position, 3.0)), "the position never changes"),
        (lambda r: replace(r, effort=np.full_like(r.effort, np.nan)), "0 samples have both motion and effort"),
        (lambda r: AxisRecording(r.name, r.time_s[:100], r.position[:100], r.effort[:100]), "100 samples"),
    ],
    ids=["effort", "position", "nothing", "short"],
)
def test_what_cannot_be_judged_says_why(spoil: object, reason: str) -> None:
    assert callable(spoil)
    found = diagnosed(data_of(spoil(DRY.recording())))
    assert found.verdict == "not judged"
    assert reason in found.statement
    assert set(found.not_testable) == set(AXIS_CAUSES)
    assert DiagnosisResult.model_validate(found).verdict == "not judged"


def test_samples_too_far_apart_for_the_motion_are_not_judged() -> None:
    recording = DRY.recording()
    position, effort = (np.resize(signal[::50], 250) for signal in (recording.position, recording.effort))
    time_s = np.arange(250, dtype=np.float64) * 0.2
    found = diagnosed(data_of(AxisRecording("seldom", time_s, position, effort)))
    assert found.verdict == "not judged"
    assert "too slowly to tell its acceleration" in found.statement


def test_a_known_cause_that_is_none_is_refused_with_the_nearest() -> None:
    with pytest.raises(UsageError, match="nearest valid cause of an axis: viscous_friction"):
        diagnosed(data_of(DRY.recording()), AxisFacts(known=("viscous",)))


def test_an_axis_of_which_everything_is_left_out_is_refused() -> None:
    with pytest.raises(UsageError, match="every recording is left out"):
        diagnosed(data_of(DRY.recording()), AxisFacts(left_out="m*"))


@pytest.mark.parametrize("cause", AXIS_CAUSES.values(), ids=lambda cause: cause.name)
def test_every_cause_declares_what_it_is(cause: AxisEffect) -> None:
    assert cause.repair and cause.control and cause.amplitudes[0].least > 0
    assert all(par.meaning and par.low <= par.null <= par.high for par in cause.pars)
