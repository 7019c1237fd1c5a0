"""The study's "k value calculation": one lattice stiffness per force, then an exponential through them.

For each force: simulate with a guessed k, compare the depth with the measured one, adjust, repeat. Because the
equilibrium depends on F/k only, one sweep phi(d) = R/k gives the same answer without a search: k_i = F_i / phi(d_i).
Both are here, so they can be compared.
"""

from collections.abc import Callable

import numpy as np

from rig.errors import DataError
from rig.tissue.intervals import student_reach
from rig.tissue.lattice.fire import NotConverged, relax
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.sweep import RELATIVE_TOLERANCE, Sweep
from rig.tissue.laws import FloatArray
from rig.tissue.summary import IndexFit, KPoint

_LEAST_POINTS = 4  # two for a and b, two for an interval
_MOST_SIMULATIONS = 30  # twice the halvings that _FORCE_TOLERANCE takes
_FORCE_TOLERANCE = 1e-4  # of the force: one step of a sensor that resolves 1 mN, at 10 N


def check_points(force_N: FloatArray, depth_mm: FloatArray) -> None:
    """Raise DataError unless forces and depths are finite, above zero, rising together, and at least four."""
    if len(force_N) != len(depth_mm) or len(force_N) < _LEAST_POINTS:
        raise DataError(
            f"{len(force_N)} forces and {len(depth_mm)} depths; at least {_LEAST_POINTS} of each are needed for a and b"
        )
    for name, unit, values in (("force", "N", force_N), ("depth", "mm", depth_mm)):
        if not np.all(np.isfinite(values)):
            raise DataError(
                f"{name} number {int(np.argmin(np.isfinite(values))) + 1} is not a number; remove it from the curve"
            )
        if values.min() <= 0.0:
            raise DataError(
                f"{name} number {int(np.argmin(values)) + 1} is {values.min():.4g} {unit}; it must be above 0 {unit}"
            )
        falls = np.flatnonzero(np.diff(values) <= 0.0)
        if len(falls):
            raise DataError(
                f"{name} falls from {values[falls[0]]:.4g} to {values[falls[0] + 1]:.4g} {unit} at number "
                f"{falls[0] + 2}; "
                "the calculation needs a curve that only rises: average or smooth it first"
            )


def exact_k(sweep: Sweep, force_N: FloatArray, depth_mm: FloatArray) -> list[KPoint]:
    """k_i = F_i / phi(d_i); raises DataError for unusable points and UsageError for depths past collapse."""
    check_points(force_N, depth_mm)
    phi = sweep.phi_mm(depth_mm)
    return [KPoint(float(f), float(d), float(f / p)) for f, d, p in zip(force_N, depth_mm, phi, strict=True)]


class Simulator:
    """Force in, depth out, for the lattice of a sweep with any k: what the study ran once per guess."""

    def __init__(self, sweep: Sweep) -> None:
        self._block = sweep.block.as_quarter()
        self._ratio = sweep.springs.cell_ratio
        self._lattice = Loaded(self._block, sweep.springs)

    def depth_mm(self, force_N: float, k_N_mm: float, near_mm: float) -> float:
        """Depth at which the lattice carries the force: the tip is moved from ``near_mm`` until R = F within 1e-4.

        Half as deep again as ``near_mm`` is the deepest it looks; a k that needs more is far too small, and that is all
        the search asks.
        """
        self._lattice.take(Springs(k_N_mm, self._lattice.springs.b, self._ratio))
        deepest = 1.5 * near_mm
        low, high = (0.0, 0.0), (0.0, 0.0)
        depth = near_mm
        for _ in range(_MOST_SIMULATIONS):
            reaction = self._react(depth)
            if abs(reaction - force_N) < _FORCE_TOLERANCE * force_N:
                return depth
            if reaction < force_N and depth >= deepest:
                return deepest
            if reaction < force_N:
                low = (depth, reaction)
            else:
                high = (depth, reaction)
            if high[0] == 0.0:
                depth = min(deepest, depth * max(1.02, force_N / reaction))
            else:
                share = (force_N - low[1]) / (high[1] - low[1])
                depth = low[0] + float(np.clip(share, 0.02, 0.98)) * (high[0] - low[0])
        raise NotConverged(
            f"no depth carries {force_N:.4g} N with k = {k_N_mm:.4g} N/mm within {_MOST_SIMULATIONS} simulations"
        )

    def _react(self, depth_mm: float) -> float:
        """Scale the last displacement field to the new depth and relax."""
        lattice = self._lattice
        before = lattice.depth_mm
        if before > 0.0:
            lattice.x += (lattice.x - lattice.rest) * (depth_mm / before - 1.0)
        for target in self._stages(before, depth_mm):
            lattice.press(target)
            relax(lattice, RELATIVE_TOLERANCE * lattice.springs.k_N_mm * self._block.spacing_mm)
        return lattice.reaction_N()

    def _stages(self, before_mm: float, depth_mm: float) -> FloatArray:
        """From rest the tip goes in by at most half a cell at a time."""
        if before_mm > 0.0:
            return np.array([depth_mm])
        count = int(np.ceil(depth_mm / (0.5 * self._block.spacing_mm)))
        return np.linspace(0.0, depth_mm, count + 1)[1:]


def search_k(
    simulate: Callable[[float, float, float], float],
    force_N: float,
    depth_mm: float,
    guess_N_mm: float,
    tolerance_mm: float = 0.005,
) -> tuple[float, int]:
    """The study's loop for one force: simulate, compare, adjust, until the depths differ by less than ``tolerance_mm``.

    Returns k and the number of simulations. ``simulate(force, k, near)`` gives a depth; a depth that is too large asks
    for more k, in proportion to the local power of depth over k found so far.
    """
    k, power = guess_N_mm, 1.0
    last: tuple[float, float] | None = None
    for count in range(1, _MOST_SIMULATIONS + 1):
        simulated = simulate(force_N, k, depth_mm)
        if abs(simulated - depth_mm) < tolerance_mm:
            return k, count
        if last is not None and simulated != last[1]:
            power = float(np.clip(np.log(k / last[0]) / np.log(last[1] / simulated), 0.2, 5.0))
        last = (k, simulated)
        k *= (simulated / depth_mm) ** power
    raise NotConverged(
        f"the search for k at {force_N:.4g} N stopped after {_MOST_SIMULATIONS} simulations at {simulated:.4g} mm, "
        f"asked for {depth_mm:.4g} mm within {tolerance_mm:g} mm; allow a larger difference"
    )


def study_loop(points: list[KPoint], sweep: Sweep, progress: Callable[[int], None] | None = None) -> list[KPoint]:
    """Run the search for every point, each starting from the k of the one before, as a person would."""
    simulator = Simulator(sweep)
    found: list[KPoint] = []
    for index, point in enumerate(points):
        guess = found[-1].k_loop_N_mm if found and found[-1].k_loop_N_mm else point.force_N / point.depth_mm / 16.0
        k, count = search_k(simulator.depth_mm, point.force_N, point.depth_mm, guess)
        found.append(KPoint(point.force_N, point.depth_mm, point.k_exact_N_mm, k, count))
        if progress is not None:
            progress(index + 1)
    return found


def fit_index(points: list[KPoint]) -> IndexFit:
    """a and b by least squares on ln k against depth."""
    x, y = np.array([p.depth_mm for p in points]), np.log([p.k_exact_N_mm for p in points])
    (b, level), covariance = np.polyfit(x, y, 1, cov=True)
    b_reach, level_reach = student_reach(len(x) - 2) * np.sqrt(np.diag(covariance))
    spread = float(np.var(y))
    return IndexFit(
        float(np.exp(level)),
        float(b),
        (float(np.exp(level - level_reach)), float(np.exp(level + level_reach))),
        (float(b - b_reach), float(b + b_reach)),
        1.0 - float(np.mean((y - level - b * x) ** 2)) / spread if spread > 0.0 else 1.0,
    )
