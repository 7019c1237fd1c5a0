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
from rig.tissue.lattice.health import inverted_cells
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
    """One settled state of the whole block."""

    depth_mm: float
    reaction_N: float
    inverted_cells: int


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
        good = [not point.inverted_cells and bool(up) for point, up in zip(self.points, rising, strict=True)]
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
                cause = f"{point.inverted_cells} cells inverted" if point.inverted_cells else "the force falls"
                return f"between {before:.3g} and {point.depth_mm:.3g} mm {cause}"
        return None

    def interpolant(self) -> PchipInterpolator:
        """phi over the intact branch, monotone cubic."""
        good = self.intact
        return PchipInterpolator(self.depth_mm[good], self.force_over_k_mm[good])

    def phi_mm(self, depth_mm: Floats | float) -> Floats:
        """R/k at given depths; refuses depths the intact branch does not reach."""
        depth = np.asarray(depth_mm, dtype=float)
        if not np.all(np.isfinite(depth)):
            raise UsageError("depth holds a value that is not a number; remove it from the curve")
        worst = depth.flat[np.argmax(np.abs(depth - 0.5 * self.deepest_mm))] if depth.size else 0.0
        if not 0.0 <= worst <= self.deepest_mm * (1.0 + 1e-9):
            reason = self.collapse() or f"the sweep ends at {self.deepest_mm:.3g} mm"
            raise UsageError(
                f"depth of {worst:.4g} mm lies outside 0 ... {self.deepest_mm:.4g} mm, which this lattice carries: "
                f"{reason}; sweep deeper, or use the stabilised mode"
            )
        return np.asarray(self.interpolant()(depth))


def settle(lattice: Loaded) -> Equilibrium:
    """Relax to equilibrium under the present tip depth and describe the result."""
    relax(lattice, RELATIVE_TOLERANCE * lattice.springs.k_N_mm * lattice.block.spacing_mm)
    return Equilibrium(lattice.depth_mm, lattice.reaction_N(), inverted_cells(lattice))


def push(
    lattice: Loaded, depths_mm: Iterable[float], disturb: Callable[[Loaded], None] | None = None
) -> Iterator[Equilibrium]:
    """Yield one equilibrium per depth, in order.

    Each starts from the displacement field extrapolated along the last step, after ``disturb``; a depth that does not
    settle is approached in halves.
    """
    past, last = 0.0, 0.0
    before, now = aligned_copy(lattice.block, lattice.x), aligned_copy(lattice.block, lattice.x)
    for depth in depths_mm:
        reached = last
        for halving in range(_HALVINGS + 1):
            try:
                while reached < depth:
                    target = min(depth, reached + (depth - last) / 2**halving)
                    _extrapolate(lattice, before, now, (target - reached) / (reached - past) if reached > past else 0.0)
                    if disturb is not None:
                        disturb(lattice)
                    lattice.press(target)
                    result = settle(lattice)
                    before[:], now[:], past, reached = now, lattice.x, reached, target
                break
            except NotConverged:
                lattice.x[:] = now
                if halving == _HALVINGS:
                    raise
        last = depth
        yield result


def _extrapolate(lattice: Loaded, before: Matrix, now: Matrix, factor: float) -> None:
    """Continue the last step's displacement; a guess that would turn a cell over is the solver's to repair."""
    np.subtract(now, before, out=lattice.x)
    lattice.x *= min(factor, 1.0)
    lattice.x += now


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
    steps = int(np.ceil(depth_mm / step_mm - 1e-9))
    for point in push(lattice, np.linspace(0.0, depth_mm, steps + 1)[1:]):
        points.append(point)
        if progress is not None:
            progress(point.depth_mm)
    return Sweep(block, springs, tuple(points))
