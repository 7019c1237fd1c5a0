"""Causes planted in a session's own recordings: what is added is the cause, and what is said is what was found."""

from dataclasses import replace

import numpy as np
import pytest

from rig.diagnosis.answers import Diagnosis, limits
from rig.diagnosis.effects.bench import BACKLASH, FRICTION, SURFACE_MOTION, TIME_OFFSET, ZERO_DRIFT
from rig.diagnosis.estimates import ErrorBudget, SmallestSize
from rig.diagnosis.fit import Fit, first_fit
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.observations import observe, working_period
from rig.diagnosis.planting import (
    ENOUGH,
    TRIALS,
    TRIED_RATE_HZ,
    Planting,
    count_found,
    drawn,
    is_found,
    is_named,
    planted,
    smallest_found,
    with_tried_sizes,
    without_one,
)
from rig.diagnosis.run import diagnose_session
from rig.trials.trial import Trial, TrialSet
from tests.rig.diagnosis.test_floor import SPEEDS, motion

NOISE_N, SURFACE_MM, ONE_WAY = 0.003, 20.0, np.array([1.0])
# Any gain is beyond chance: what is found then hangs on the cause and on the support of its name alone.
NO_CHANCE = np.zeros(400), np.zeros(0)


def index_session(count: int = 6) -> TrialSet:
    """Cycles of 6 mm on tissue that the simulation is right about, with white noise."""
    rng, trials, begin_s = np.random.default_rng(3), list[Trial](), 0.0
    for number, speed in enumerate(np.resize(SPEEDS, count)):
        time_s, depth_mm = motion(float(speed))
        force_N = 0.2 * np.maximum(depth_mm, 0) * np.exp(0.15 * np.maximum(depth_mm, 0))
        noisy_N = force_N + rng.normal(0, NOISE_N, len(time_s))
        trials.append(Trial(f"cycle {number}", begin_s + time_s, noisy_N, begin_s + time_s, SURFACE_MM + depth_mm))
        begin_s += float(time_s[-1]) + 1.0
    return TrialSet("made", tuple(trials))


@pytest.fixture(scope="module")
def model() -> Fit:
    return first_fit(IndentationProblem(observe(index_session())))


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    """What is said of the session as it is."""
    return diagnose_session(index_session())


def added(planting: Planting, size: float) -> np.ndarray:
    """What the cause adds to the readings of force."""
    before, after = planting.model.problem, planted(planting, size)
    return after.channels[0].observed - before.channels[0].observed


def test_friction_is_planted_as_dahl_has_it(model: Fit) -> None:
    """On the way in from rest F (1 - 2 exp(-x / l)), in closed form, in every recording."""
    shape = {"friction_length_mm": 0.3, "friction_start": -1.0}
    newton = added(Planting(model, FRICTION, shape, ONE_WAY), 0.4)
    drive = model.problem.data.drive  # type: ignore[attr-defined]
    for begin, end in zip(drive.starts[:-1], drive.starts[1:], strict=True):
        inward = slice(begin, begin + int(np.argmax(drive.position_mm[begin:end])))
        way_mm = drive.position_mm[inward] - drive.position_mm[begin]
        assert newton[inward] == pytest.approx(0.4 * (1 - 2 * np.exp(-way_mm / 0.3)), abs=0.01)


def test_readings_keep_their_own_noise_and_a_zero_drifts_beside_it(model: Fit) -> None:
    newton = added(Planting(model, ZERO_DRIFT, {}, np.array([-1.0])), 36.0)
    time_s = model.problem.variables()["session time"]
    assert newton == pytest.approx(-0.01 * (time_s - 0.5 * (time_s[0] + time_s[-1])), abs=1e-9)


def test_a_lost_motion_is_planted_on_the_way_out_only(model: Fit) -> None:
    newton = added(Planting(model, BACKLASH, {}, ONE_WAY), 0.2)
    velocity = model.problem.variables()["velocity"]
    depth_mm = model.problem.variables()["depth"] - SURFACE_MM
    out = (velocity < -5) & (depth_mm > 1) & (depth_mm < 5)
    expected = 0.2 * 0.2 * np.exp(0.15 * depth_mm[out]) * (1 + 0.15 * depth_mm[out])  # width times tangent
    assert newton[out] == pytest.approx(expected, rel=0.05)
    assert newton[(velocity > 1) & (depth_mm > 1)] == pytest.approx(0.0, abs=1e-9)


def test_each_cause_is_drawn_with_a_shape_that_is_looked_for_and_in_each_direction(model: Fit) -> None:
    rng = np.random.default_rng(0)
    ways = [float(drawn(model, TIME_OFFSET, rng, False).direction[0]) for _ in range(20)]
    assert set(ways) == {-1.0, 1.0}
    assert all(drawn(model, FRICTION, rng, True).direction == 1.0 for _ in range(5))
    assert len({drawn(model, FRICTION, rng, False).shape["friction_length_mm"] for _ in range(30)}) == 4


def test_every_other_shape_is_slow_as_a_breath_is(model: Fit) -> None:
    rng = np.random.default_rng(0)
    fast, slow = (
        [drawn(model, SURFACE_MOTION, rng, is_slow).shape["surface_motion_Hz"] for _ in range(20)]
        for is_slow in (False, True)
    )
    assert np.median(slow) < 0.3 * np.median(fast)


def test_a_plant_is_missed_when_small_and_found_when_large(model: Fit) -> None:
    planting = Planting(model, FRICTION, {"friction_length_mm": 0.15, "friction_start": -0.5}, ONE_WAY)
    assert not is_found(planting, 0.0002, (FRICTION,), NO_CHANCE)
    assert is_found(planting, 0.1, (FRICTION,), NO_CHANCE)
    # What chance alone reaches is no finding, however large the plant.
    assert not is_found(planting, 0.1, (FRICTION,), (np.full(400, 1e9), np.zeros(0)))


def test_counting_ends_where_four_of_five_are_out_of_reach(monkeypatch: pytest.MonkeyPatch, model: Fit) -> None:
    answers = iter([True, False, False])
    monkeypatch.setattr("rig.diagnosis.planting.is_found", lambda *_: next(answers))
    assert count_found([Planting(model, FRICTION, {}, ONE_WAY)] * TRIALS, (FRICTION,), 1.0, NO_CHANCE) == 1


def test_the_size_stated_is_the_first_found_in_four_of_five_and_none_where_no_size_in_bounds_is(
    monkeypatch: pytest.MonkeyPatch, model: Fit
) -> None:
    tried = list[float]()
    monkeypatch.setattr("rig.diagnosis.planting.is_named", lambda *_: True)

    def found_from_two(_plantings: object, _variants: object, size: float, _maxima: object) -> int:
        tried.append(size)
        return ENOUGH if size >= 2.0 else ENOUGH - 1

    monkeypatch.setattr("rig.diagnosis.planting.count_found", found_from_two)
    plantings = [Planting(model, FRICTION, {}, ONE_WAY)] * TRIALS
    assert smallest_found(plantings, (FRICTION,), 1.0, NO_CHANCE) == SmallestSize(2.25, "N", ENOUGH, TRIALS)
    assert tried == [1.0, 1.5, 2.25]
    # A dead band of more than 3 mm is out of bounds.
    monkeypatch.setattr("rig.diagnosis.planting.count_found", lambda *_: 0)
    assert smallest_found(plantings, (BACKLASH,), 3.1, NO_CHANCE) is None


def test_a_size_that_a_whole_search_gives_to_another_cause_is_not_stated(
    monkeypatch: pytest.MonkeyPatch, model: Fit
) -> None:
    named_from = 2.0
    monkeypatch.setattr("rig.diagnosis.planting.count_found", lambda *_: TRIALS)
    monkeypatch.setattr("rig.diagnosis.planting.is_named", lambda _planting, size: size > named_from)
    stated = smallest_found([Planting(model, FRICTION, {}, ONE_WAY)] * TRIALS, (FRICTION,), 1.0, NO_CHANCE)
    assert stated == SmallestSize(2.25, "N", TRIALS, TRIALS)


def test_a_whole_search_names_what_is_large_and_nothing_where_nothing_is_planted(model: Fit) -> None:
    planting = Planting(model, FRICTION, {"friction_length_mm": 0.15, "friction_start": -0.5}, ONE_WAY)
    assert is_named(planting, 0.1)
    assert not is_named(planting, 0.0)


def test_every_trial_leaves_another_recording_out() -> None:
    parts = list(without_one(index_session(5)))
    assert len(parts) == TRIALS and len({part.names for part in parts}) == TRIALS
    assert all(len(part.names) == 4 for part in parts)


@pytest.mark.parametrize("rate_Hz", [100, 150, 202, 203, 225, 337, 338, 500, 1000, 4000])
def test_thinned_recordings_still_show_what_acts_fast(rate_Hz: float) -> None:
    time_s = np.arange(0, 5, 1 / rate_Hz)
    thinned_Hz = 1 / working_period([Trial("", time_s, time_s, time_s, time_s)], TRIED_RATE_HZ)
    assert 99 < thinned_Hz < 203


def test_sizes_are_tried_for_what_an_estimate_is_there_for_and_the_table_says_how_often(
    monkeypatch: pytest.MonkeyPatch, found: Diagnosis
) -> None:
    kept = {name: found.detectable[name] for name in ("friction", "zero_drift")}
    monkeypatch.setattr("rig.diagnosis.planting.is_named", lambda *_: True)
    monkeypatch.setattr(
        "rig.diagnosis.planting.count_found",
        lambda _plantings, variants, *_: 5 if variants[0] is FRICTION else 0,
    )
    tried = with_tried_sizes(replace(found, detectable=kept), index_session())
    assert tried.detectable == {"friction": SmallestSize(kept["friction"].minimum, "N", 5, 5)}
    assert "it was not found, up to " in tried.not_testable["zero_drift"]
    nothing = replace(found, detectable={})
    assert with_tried_sizes(nothing, index_session()) is nothing


@pytest.mark.parametrize("verdict", ["unexplained", "not judged"])
def test_no_size_is_stated_where_something_may_be_left_that_hides_it(
    monkeypatch: pytest.MonkeyPatch, found: Diagnosis, verdict: str
) -> None:
    monkeypatch.setattr("rig.diagnosis.run.verdict_of", lambda *_: (verdict, ("depth",)))
    left = diagnose_session(index_session())
    assert found.verdict == "adequate" and "friction" in found.detectable
    assert left.verdict == verdict and left.detectable == {}
    assert all("may hide it" in left.not_testable[name] for name in found.detectable)
    assert with_tried_sizes(left, index_session()) is left


def test_no_size_is_stated_where_the_model_misses_what_could_be_reached(found: Diagnosis) -> None:
    assert found.search is not None
    problem = found.search.after.problem
    budget = ErrorBudget(0.02, 0.0112, 0.01, 0.01, None, None, None, None, {})
    visible, reasons = limits(problem, found.search, budget)
    assert not visible
    assert reasons["friction"] == (
        "not judged: what is left may hide it; 0.01 N could be reached (at most 1.1 times that)"
    )
    reached, _ = limits(problem, found.search, replace(budget, extended_N=0.0109))
    assert "friction" in reached
    # The floor is itself a model, and may be as wrong: noise of 0.005 N says so.
    visible, reasons = limits(problem, found.search, replace(budget, extended_N=0.0109, noise_N=0.005))
    assert not visible
    assert reasons["friction"].endswith("it is 2.18 times the noise (at most 1.25)")
