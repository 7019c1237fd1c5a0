"""What could be reached: flexible tissue against forces of other formulas, repeats against noise that is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from rig.diagnosis.effects.bench import FRICTION
from rig.diagnosis.estimates import ErrorBudget, Estimate
from rig.diagnosis.fit import Fit, first_fit
from rig.diagnosis.flexible import Basis
from rig.diagnosis.floor import error_budget, explained_share, flexible_errors, noise_N
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.left_out import LeftOut, left_out, with_own_terms
from rig.diagnosis.observations import Observations, observe
from rig.diagnosis.repeats import compare_repeats
from rig.diagnosis.verdict import left_sentence, shortfalls
from rig.simulation.drive import MeasuredMotion
from rig.trials.trial import Trial, TrialSet

NOISE_N, RATE_HZ = 0.004, 200.0
SPEEDS = (5.0, 5.0, 10.0, 10.0, 20.0, 20.0)
# Contact [mm], scale and zero [N] of each cycle: wider apart than any scatter of one touch.
OWN = np.array([[0, 1, 0], [0.1, 1.1, 0.2], [-0.1, 0.95, -0.1], [0.05, 1.0, 0.1], [-0.2, 0.9, 0], [0.15, 1.2, 0.3]])


def motion(speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Time and depth of 3 mm of air, 6 mm of tissue, half a second of hold, and back."""
    corners = np.cumsum([0, 0.5, 9 / speed, 0.5, 9 / 10.0, 0.5])
    time = np.arange(0, corners[-1], 1 / RATE_HZ)
    return time, np.interp(time, corners, [-3, -3, 6, 6, -3, -3])


def fung(depth: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Tong and Fung's exponential, 0.3 N (exp(0.25 x) - 1), and two relaxations of 0.05 and 0.6 s, by Euler's steps."""
    elastic = 0.3 * np.expm1(0.25 * np.maximum(depth, 0))
    force = elastic.copy()
    for share, tau in ((0.2, 0.05), (0.3, 0.6)):
        keep = np.exp(-1 / RATE_HZ / tau)
        force += share * lfilter([keep], [1, -keep], np.diff(elastic, prepend=elastic[0]))
    return np.asarray(np.maximum(force, 0.0) + 0 * time)


def session(seed: int = 1) -> Observations:
    """Six cycles, two at each speed, each with a contact, a scale and a zero of its own."""
    rng, trials, begin = np.random.default_rng(seed), [], 0.0
    for number, (speed, (contact, scale, zero)) in enumerate(zip(SPEEDS, OWN, strict=True)):
        time, depth = motion(speed)
        force = scale * fung(depth - contact, time) + zero + rng.normal(0, NOISE_N, len(time))
        trials.append(Trial(f"cycle {number}", begin + time, force, begin + time, 20 + depth))
        begin += float(time[-1]) + 1.0
    return observe(TrialSet("made", tuple(trials)))


@pytest.fixture(scope="module")
def base() -> Fit:
    """The index simulation, which knows neither this law nor its memory."""
    return first_fit(IndentationProblem(session()))


@pytest.fixture(scope="module")
def budget(base: Fit) -> ErrorBudget:
    return error_budget(base, base)


def test_a_flexible_tissue_reaches_the_noise_that_the_simulation_misses_on_a_law_it_does_not_hold(
    budget: ErrorBudget,
) -> None:
    assert budget.noise_N == pytest.approx(NOISE_N, rel=0.1)
    assert budget.flexible_N == budget.floor_N < 1.25 * NOISE_N
    assert budget.base_N > 5 * NOISE_N


def test_a_model_whose_tip_never_reaches_the_tissue_has_no_other_tissue_laid_under_it(base: Fit) -> None:
    deepest_mm = float(base.problem.variables()["depth"].max())
    beyond = replace(base, values={**base.values, "surface_mm": deepest_mm + 30.0})
    assert flexible_errors(beyond, (FRICTION,), True).rms == left_out(beyond).rms


def test_such_a_simulation_is_not_called_right(budget: ErrorBudget) -> None:
    said = shortfalls(budget)
    assert len(said) == 3
    assert budget.shared_by_repeats is not None and budget.shared_by_repeats.low > 1
    assert budget.explained_share is not None and budget.explained_share.value == 0
    right = replace(budget, extended_N=budget.floor_N, shared_by_repeats=Estimate(0.0, -0.1, 0.2))
    assert shortfalls(replace(right, noise_N=budget.floor_N)) == []
    assert left_sentence(replace(right, extended_N=0.05, noise_N=0.03, repeatability_N=0.05)) == (
        "what is left is 0.05 N, of which 0.03 N is noise and 0.04 N differs between repeats"
    )
    below = "what is left is 0.05 N, no more than the noise (0.06 N)"
    assert left_sentence(replace(right, extended_N=0.05, floor_N=0.05, noise_N=0.06)) == below
    # What a better model could reach is left, noise or not.
    assert "of which" in left_sentence(replace(right, extended_N=0.05, floor_N=0.01, noise_N=0.06))


def test_own_terms_take_up_what_differs_between_recordings_and_are_said(base: Fit, budget: ErrorBudget) -> None:
    own = with_own_terms(base, base.whitener.blind)
    assert left_out(own).rms < 0.5 * float(np.std(base.residual))
    assert budget.scatter["zero"].sd == pytest.approx(OWN[:, 2].std(ddof=1), rel=0.2)


def test_a_force_of_the_basis_is_its_columns_times_its_factors(base: Fit) -> None:
    assert isinstance(base.problem, IndentationProblem)
    basis = Basis(base.problem.data.drive, 6.0)
    factors = np.random.default_rng(2).uniform(0, 1, basis.size)
    contact_mm = 20 + OWN[:, 0]
    np.testing.assert_allclose(basis.force(contact_mm, factors), basis.columns(contact_mm) @ factors, atol=1e-9)
    depth, splines = basis.table
    assert np.all(np.diff(splines, axis=0) >= -1e-12)
    np.testing.assert_allclose(splines[[0, -1]], [[0] * 9, [1] * 9], atol=1e-12)
    # Nine splines follow the law that made the session to a thousandth.
    law = np.expm1(0.25 * depth)
    fitted = splines @ np.linalg.lstsq(splines, law, rcond=None)[0]
    assert np.abs(fitted - law).max() < 1e-3 * law.max()


def test_noise_is_that_of_the_air_after_what_is_named_there(base: Fit) -> None:
    own = with_own_terms(base, base.whitener.blind)
    assert noise_N(own) == pytest.approx(NOISE_N, rel=0.1)
    assert isinstance(own.problem, IndentationProblem)


def test_noise_is_no_less_than_what_a_converter_rounds_off(base: Fit) -> None:
    """Uniform over a step of 0.05 N: a reading that rests on one shows none of it."""
    own = with_own_terms(base, base.whitener.blind)
    assert isinstance(own.problem, IndentationProblem)
    coarse = replace(own, problem=replace(own.problem, data=replace(own.problem.data, step_N=0.05)))
    assert noise_N(coarse) == pytest.approx(0.05 / np.sqrt(12))


def test_noise_without_air_is_that_of_holds_once_they_have_settled(base: Fit) -> None:
    own = with_own_terms(base, base.whitener.blind)
    assert isinstance(own.problem, IndentationProblem)
    drive = own.problem.data.drive
    # A surface far above, and holds of two seconds, in the last three quarters of which force has all but relaxed.
    slower = replace(drive, time_s=4 * drive.time_s)
    assert noise_N(pressed_all_the_time(own, slower)) == pytest.approx(NOISE_N, rel=0.15)
    assert noise_N(pressed_all_the_time(own, drive)) is None, "half a second of hold is not settled"
    going = replace(slower, position_mm=20 + slower.in_recording_s)
    assert noise_N(pressed_all_the_time(own, going)) is None


def pressed_all_the_time(own: Fit, drive: MeasuredMotion) -> Fit:
    """The fit on another motion, with its surface above all of it."""
    assert isinstance(own.problem, IndentationProblem)
    problem = IndentationProblem(replace(own.problem.data, drive=drive))
    return replace(own, problem=problem, values={**own.values, "surface_mm": 10.0})


def repeated(common: float, noise: float, seed: int = 3) -> tuple[LeftOut, Observations]:
    """Errors that two repeats share, of rms ``common``, beside noise of their own."""
    data, rng = session(), np.random.default_rng(seed)
    shared = np.concatenate([common * np.sqrt(2) * np.sin(60 * motion(speed)[0]) for speed in SPEEDS])
    error = shared + rng.normal(0, noise, data.drive.size)
    return LeftOut(error, np.ones(data.drive.size, bool), data.drive.recording), data


@pytest.mark.parametrize("ratio", [0.0, 0.5, 2.0])
def test_repeats_share_what_they_were_given_to_share(ratio: float) -> None:
    errors, data = repeated(np.sqrt(ratio) * 0.01, 0.01)
    found = compare_repeats(errors, data.drive, np.full(6, 20.0))
    assert found is not None and found.shared is not None
    assert found.pure_error_N == pytest.approx(0.01, rel=0.1)
    assert found.shared.low <= ratio <= found.shared.high
    assert found.shared.high - found.shared.low < 0.5 + ratio


def test_motions_of_other_speeds_are_no_repeats() -> None:
    errors, data = repeated(0.01, 0.01)
    first_of_each = np.isin(data.drive.recording, [0, 2, 4])
    drive = replace(
        data.drive,
        **{
            name: getattr(data.drive, name)[first_of_each]
            for name in ("time_s", "position_mm", "velocity_mm_s", "acceleration_mm_s2", "cycle")
        },
        recording=data.drive.recording[first_of_each] // 2,
    )
    some = LeftOut(errors.residual[first_of_each], errors.judged[first_of_each], drive.recording)
    assert compare_repeats(some, drive, np.full(3, 20.0)) is None


def test_a_recording_of_which_no_row_is_judged_has_no_error() -> None:
    recording, judged = np.array([0, 0, 1, 1, 2, 2]), np.array([True, True, False, False, True, False])
    left = LeftOut(np.array([1.0, 3.0, 9.0, 9.0, 1.0, 9.0]), judged, recording)
    assert left.square_errors.tolist() == [5.0, 1.0] and left.seen.tolist() == [True, False, True]
    assert left.rms == pytest.approx(np.sqrt(3.0))
    none = replace(left, judged=np.zeros(6, bool))
    assert none.rms == 0.0
    assert explained_share(none.square_errors, none.square_errors, none.square_errors) is None


def test_the_share_explained_is_of_power_and_left_out_where_nothing_could_be_gained() -> None:
    base, half, floor = (np.full(4, size**2) for size in (0.05, 0.04, 0.03))
    found = explained_share(base, half, floor)
    assert found is not None
    assert (found.value, found.low, found.high) == pytest.approx((9 / 16,) * 3)
    assert explained_share(base, base, np.full(4, 0.046**2)) is None


def test_draws_in_which_nothing_could_be_gained_leave_the_interval_of_the_share_finite() -> None:
    # One recording of six has all that can be taken off; four draws in ten are without it.
    base, extended, floor = (np.array([own, 1.0, 1.0, 1.0, 1.0, 1.0]) for own in (50.0, 1.0, 1.0))
    extended[1:] = 1.1
    found = explained_share(base, extended, floor)
    assert found is not None
    # Without it 0.1 is lost of the least worth explaining, 1 - 1 / 1.1^2 of the error.
    assert found.low == pytest.approx(-0.1 / (1 - 1 / 1.1**2))
    assert found.value == pytest.approx((55.0 - 6.5) / (55.0 - 6.0))
