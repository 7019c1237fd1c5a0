"""The solver of the fits against a dense one of scipy's, on problems small enough to understand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rig.tissue.arrow import LeastSquares, Slopes, Values, minimise, normal_equations

Column = NDArray[np.float64]
CURVES, POINTS = 4, 30


class Exponentials:
    """Curves a exp(b (x - own)) with one shift each."""

    def __init__(self, seed: int, noise: float = 0.01) -> None:
        random = np.random.default_rng(seed)
        self.x = np.tile(np.linspace(0, 2, POINTS), CURVES)
        self.curve_of = np.repeat(np.arange(CURVES), POINTS)
        self.shifts = random.uniform(-0.2, 0.2, CURVES)
        self.shifts -= self.shifts.mean()
        self.y = 1.5 * np.exp(0.8 * (self.x - self.shifts[self.curve_of])) + noise * random.standard_normal(len(self.x))

    def residuals(self, values: Values) -> Column:
        a, b = values.common
        return np.asarray(a * np.exp(b * (self.x - values.own[self.curve_of])) - self.y)

    def slopes(self, values: Values) -> Slopes:
        a, b = values.common
        grown = np.exp(b * (self.x - values.own[self.curve_of]))
        return Slopes(
            np.column_stack([grown, a * (self.x - values.own[self.curve_of]) * grown]), np.asarray(-a * b * grown)
        )

    def problem(self, upper_b: float = 5.0, reach: float = 1.0, hold: float = 0.5) -> LeastSquares:
        return LeastSquares(
            self.residuals, self.slopes, self.curve_of,
            lower=Values(np.array([0.0, 0.0]), np.full(CURVES, -reach)),
            upper=Values(np.array([9.0, upper_b]), np.full(CURVES, reach)),
            holds=np.full(CURVES, hold),
        )  # fmt: skip


START = Values(np.array([1.0, 0.3]), np.zeros(CURVES))


def dense(problem: LeastSquares) -> Column:
    """The same minimum by a solver that knows nothing of arrows."""

    def residuals(v: Column) -> Column:
        return np.concatenate([problem.residuals(Values(v[:2], v[2:])), np.sqrt(problem.holds) * v[2:]])

    found = least_squares(
        residuals,
        np.concatenate(START),
        bounds=(np.concatenate(problem.lower), np.concatenate(problem.upper)),
        xtol=1e-14, ftol=1e-14, gtol=1e-14,
    )  # fmt: skip
    return np.asarray(found.x, float)


@given(st.integers(0, 10_000))
def test_it_finds_what_a_dense_solver_finds(seed: int) -> None:
    problem = Exponentials(seed).problem()
    found = minimise(problem, START, 100)
    assert found is not None
    assert np.concatenate(found) == pytest.approx(dense(problem), abs=1e-4)


def test_without_noise_it_finds_the_truth() -> None:
    exponentials = Exponentials(1, noise=0.0)
    found = minimise(exponentials.problem(hold=0.0), START, 100)
    assert found is not None
    assert found.common[1] == pytest.approx(0.8, abs=1e-6)
    assert np.diff(found.own) == pytest.approx(np.diff(exponentials.shifts), abs=1e-6)


@pytest.mark.parametrize(("upper_b", "reach"), [(0.5, 1.0), (5.0, 0.03), (0.5, 0.03)])
def test_at_bounds_it_finds_what_a_dense_solver_finds(upper_b: float, reach: float) -> None:
    problem = Exponentials(3).problem(upper_b, reach)
    found = minimise(problem, START, 200)
    assert found is not None
    assert np.concatenate(found) == pytest.approx(dense(problem), abs=2e-3)
    assert np.all(np.abs(found.own) <= reach)
    assert found.common[1] <= upper_b


def test_a_strong_hold_keeps_the_own_parameters_at_zero() -> None:
    found = minimise(Exponentials(1).problem(hold=1e9), START, 100)
    assert found is not None
    assert found.own == pytest.approx(np.zeros(CURVES), abs=1e-4)


def test_too_few_evaluations_are_no_answer() -> None:
    assert minimise(Exponentials(1).problem(), START, 2) is None


def test_the_normal_equations_are_j_transposed_j() -> None:
    problem = Exponentials(2).problem(hold=0.25)
    slopes = problem.slopes(START)
    own = np.where(problem.curve_of[:, None] == np.arange(CURVES), slopes.own[:, None], 0.0)
    jacobian = np.hstack([slopes.common, own])
    expected = jacobian.T @ jacobian + np.diag([0, 0, *problem.holds])
    assert normal_equations(problem, slopes).dense() == pytest.approx(expected)


def test_a_parameter_without_any_effect_stays_where_it_is() -> None:
    exponentials = Exponentials(1)

    def slopes(values: Values) -> Slopes:
        return Slopes(np.zeros((len(exponentials.x), 2)), np.zeros(len(exponentials.x)))

    problem = exponentials.problem(hold=0.0)._replace(residuals=lambda _: np.ones(len(exponentials.x)), slopes=slopes)
    found = minimise(problem, START, 50)
    assert found is not None
    assert np.concatenate(found) == pytest.approx(np.concatenate(START))
