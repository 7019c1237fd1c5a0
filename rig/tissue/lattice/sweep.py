"""Push the tip in, step by step, on one branch: the curve phi(d) = R(d)/k of a geometry.

With one stiffness for all springs the equilibrium depends on F/k only, so one sweep per geometry serves every k: F = k
phi(d). Past collapse the curve depends on the way it was reached; such points are kept but marked.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from rig.errors import UsageError
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.fire import NotConverged, relax
from rig.tissue.lattice.health import Health, examine
from rig.tissue.lattice.numba_types import Floats, Matrix
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded, aligned_copy

DEFAULT_STEP_MM = 0.5
RELATIVE_TOLERANCE = (
    5e-6  # largest force left on a node over k d: the study's acceleration threshold 0.0005 at m = 0.001, k = 0.1
)
_HALVINGS = 4


@dataclass(frozen=True)
class Equilibrium:
    """One settled state; forces and energy of the whole block."""

    depth_mm: float
    reaction_N: float
    energy_N_mm: float
    residual_N: float
    steps: int
    health: Health


@dataclass(frozen=True)
class Sweep:
    """Equilibria along one loading path, for springs of 1 N/mm scaled by k. ``intact`` is False from the first sign of
    collapse on.
    """

    block: Block
    springs: Springs
    points: tuple[Equilibrium, ...]

    @property
    def depth_mm(self) -> Floats:
        """Depths, starting at 0."""
        return np.array([0.0, *(point.depth_mm for point in self.points)])

    @property
    def force_over_k_mm(self) -> Floats:
        """phi: reaction over spring stiffness, in mm."""
        return np.array([0.0, *(point.reaction_N for point in self.points)]) / self.springs.k_N_mm

    @property
    def intact(self) -> list[bool]:
        """Per depth: no inverted cell and no falling force up to here."""
        rising = np.diff(self.force_over_k_mm) > 0.0
        good = [point.health.intact and bool(up) for point, up in zip(self.points, rising, strict=True)]
        return [True, *(all(good[: i + 1]) for i in range(len(good)))]

    @property
    def deepest_mm(self) -> float:
        """Largest depth before collapse."""
        return float(self.depth_mm[self.intact][-1])

    def collapse(self) -> str | None:
        """What broke first, in words, or None."""
        for index, good in enumerate(self.intact):
            if not good:
                point, before = self.points[index - 1], self.depth_mm[index - 1]
                cause = (
                    f"{point.health.inverted_cells} cells inverted" if not point.health.intact else "the force falls"
                )
                return f"between {before:.3g} and {point.depth_mm:.3g} mm {cause}"
        return None

    def interpolant(self) -> PchipInterpolator:
        """phi over the intact branch, monotone cubic."""
        good = self.intact
        return PchipInterpolator(self.depth_mm[good], self.force_over_k_mm[good])

    def phi_mm(self, depth_mm: Floats | float) -> Floats:
        """R/k at given depths; refuses depths the intact branch does not reach."""
        depth = np.asarray(depth_mm, dtype=float)
        self._refuse("depth", "mm", depth, self.deepest_mm)
        return np.asarray(self.interpolant()(depth))

    def slope(self, depth_mm: Floats | float) -> Floats:
        """d phi / d depth."""
        depth = np.asarray(depth_mm, dtype=float)
        self._refuse("depth", "mm", depth, self.deepest_mm)
        return np.asarray(self.interpolant().derivative()(depth))

    def depth_at(self, force_over_k_mm: Floats | float) -> Floats:
        """Depth in mm that carries F/k; refuses what the intact branch does not carry."""
        wanted = np.asarray(force_over_k_mm, dtype=float)
        highest = float(self.phi_mm(self.deepest_mm))
        self._refuse("force over spring stiffness", "mm", wanted, highest)
        curve = self.interpolant()
        found = [float(curve.solve(float(value), extrapolate=False)[0]) for value in wanted.reshape(-1)]
        return np.array(found).reshape(wanted.shape)

    def _refuse(self, what: str, unit: str, values: Floats, highest: float) -> None:
        if not np.all(np.isfinite(values)):
            raise UsageError(f"{what} holds a value that is not a number; remove it from the curve")
        worst = values.flat[np.argmax(np.abs(values - 0.5 * highest))] if values.size else 0.0
        if not 0.0 <= worst <= highest * (1.0 + 1e-9):
            reason = self.collapse() or f"the sweep ends at {self.deepest_mm:.3g} mm"
            raise UsageError(
                f"{what} of {worst:.4g} {unit} lies outside 0 ... {highest:.4g} {unit}, which this lattice "
                f"carries: {reason}; "
                "sweep deeper, or use the stabilised mode"
            )


def settle(lattice: Loaded, relative_tolerance: float = RELATIVE_TOLERANCE) -> Equilibrium:
    """Relax to equilibrium under the present tip depth or load and describe the result."""
    steps = relax(lattice, relative_tolerance * lattice.springs.k_N_mm * lattice.block.spacing_mm)
    reaction, residual = lattice.reaction_N(), lattice.residual_N()
    return Equilibrium(lattice.depth_mm, reaction, lattice.energy_N_mm(), residual, steps, examine(lattice))


def push(
    lattice: Loaded,
    levels: Iterable[float],
    relative_tolerance: float = RELATIVE_TOLERANCE,
    disturb: Callable[[Loaded], None] | None = None,
) -> Iterator[Equilibrium]:
    """Yield one equilibrium per level, in order: depth in mm, or load in N for the contact "pressure".

    Each starts from the displacement field extrapolated along the last step, after ``disturb``; a level that does not
    settle is approached in halves.
    """
    past, last = 0.0, 0.0
    before, now = aligned_copy(lattice.block, lattice.x), aligned_copy(lattice.block, lattice.x)
    for level in levels:
        reached = last
        for halving in range(_HALVINGS + 1):
            try:
                while reached < level:
                    target = min(level, reached + (level - last) / 2**halving)
                    _extrapolate(lattice, before, now, (target - reached) / (reached - past) if reached > past else 0.0)
                    if disturb is not None:
                        disturb(lattice)
                    _impose(lattice, target)
                    result = settle(lattice, relative_tolerance)
                    before[:], now[:], past, reached = now, lattice.x, reached, target
                break
            except NotConverged:
                lattice.x[:] = now
                if halving == _HALVINGS:
                    raise
        last = level
        yield result


def _extrapolate(lattice: Loaded, before: Matrix, now: Matrix, factor: float) -> None:
    """Continue the last step's displacement; a guess that would turn a cell over is the solver's to repair."""
    np.subtract(now, before, out=lattice.x)
    lattice.x *= min(factor, 1.0)
    lattice.x += now


def _impose(lattice: Loaded, level: float) -> None:
    if lattice.block.contact == "pressure":
        lattice.load_N = level
    else:
        lattice.press(level)


def sweep(
    block: Block,
    springs: Springs,
    depth_mm: float,
    step_mm: float = DEFAULT_STEP_MM,
    progress: Callable[[float], None] | None = None,
) -> Sweep:
    """Sweep a geometry to ``depth_mm`` in steps of at most ``step_mm``; ``progress(depth_mm)`` after each. Raises
    UsageError.
    """
    if not (np.isfinite(depth_mm) and 0.0 < depth_mm < 0.9 * block.height_mm):
        raise UsageError(
            f"depth of {depth_mm} mm must lie between 0 and 90 % of the block's height, {0.9 * block.height_mm:g} mm"
        )
    lattice = Loaded(block, springs)
    points = []
    for point in push(lattice, _levels(block, springs, depth_mm, step_mm)):
        points.append(point)
        if progress is not None:
            progress(point.depth_mm)
        if point.depth_mm >= depth_mm:
            break
    return Sweep(block, springs, tuple(points))


def _levels(block: Block, springs: Springs, depth_mm: float, step_mm: float) -> Floats:
    """Depths, or for the contact "pressure" loads that grow by the flat punch's stiffness per step and go on until the
    depth is met.
    """
    count = int(np.ceil(depth_mm / step_mm - 1e-9))
    if block.contact != "pressure":
        return np.linspace(0.0, depth_mm, count + 1)[1:]
    punch = springs.young_modulus_MPa(block.spacing_mm) * block.tip_diameter_mm / (1.0 - springs.poisson_ratio**2)
    return np.asarray(punch * step_mm * np.arange(1, 40 * count + 1), dtype=float)
