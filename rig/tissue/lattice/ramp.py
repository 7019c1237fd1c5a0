"""phi(d; b) = R/k of a lattice whose springs stiffen each by itself, k exp(b |strain|), over depth and exponent.

k is a factor of the force, so a fit needs least squares for k and a search for b alone (variable projection, Golub and
Pereyra 1973). Springs that stiff buckle sideways if they are loaded at once: a state found from rest, or from another
depth, may lie on another branch. Each depth is therefore settled with b = 0, and b rises from there.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.errors import DataError
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.numba_types import Floats
from rig.tissue.lattice.springs import LARGEST_EXPONENT, Springs
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.sweep import Equilibrium, push, settle

STEP = 2.0  # of b; a cubic of ln phi between is good to 1e-3
_PAST_BEST = 2  # levels of b that must fit worse than the best before the ramp ends: one may by chance
_LEAST_LEVELS = 4  # for the cubic


@dataclass(frozen=True)
class DepthRamp:
    """phi in mm, shape (n, m), at n exponents and m depths; the springs are those with b = 0."""

    block: Block
    springs: Springs
    exponents: Floats
    depth_mm: Floats
    phi_mm: Floats
    inverted_cells: int


def project(force_N: Floats, phi_mm: Floats) -> tuple[float, float]:
    """The k of least squares for F = k phi, and the sum of squares it leaves over that of F."""
    k = float(force_N @ phi_mm / (phi_mm @ phi_mm))
    return k, float(np.sum((force_N - k * phi_mm) ** 2) / (force_N @ force_N))


def ramp(
    block: Block, springs: Springs, depth_mm: Floats, force_N: Floats, progress: Callable[[float], None] | None = None
) -> DepthRamp:
    """Raise b from 0 until the forces (m,) at the depths (m,) are fitted worse again; ``progress(b)`` after each level.

    Raises DataError where the best b would be beyond what springs may have.
    """
    exponents, levels, misfits = [], [], []
    for b, points in _climb(block, springs, depth_mm.tolist()):
        exponents.append(b)
        levels.append(points)
        misfits.append(project(force_N, np.array([point.reaction_N for point in points]))[1])
        if progress is not None:
            progress(b)
        if len(misfits) >= max(_LEAST_LEVELS, int(np.argmin(misfits)) + 1 + _PAST_BEST):
            phi = np.array([[point.reaction_N for point in points] for points in levels]) / springs.k_N_mm
            inverted = max(point.inverted_cells for points in levels for point in points)
            return DepthRamp(block, replace(springs, b=0.0), np.array(exponents), depth_mm, phi, inverted)
    raise DataError(
        f"the curve rises faster than springs with an exponent of {LARGEST_EXPONENT:g} can follow: use the global k(x) "
        "of `rig fit --lattice`"
    )


def _climb(block: Block, springs: Springs, depths_mm: Sequence[float]) -> Iterator[tuple[float, list[Equilibrium]]]:
    """Equilibria at every depth for b = 0, ``STEP``, ...; each guessed from its own two last exponents."""
    lattice = Loaded(block, replace(springs, b=0.0))
    points, states = [], []
    for point in push(lattice, depths_mm):
        points.append(point)
        states.append(lattice.x.copy())
    yield 0.0, points
    before = [state.copy() for state in states]
    for b in np.arange(STEP, LARGEST_EXPONENT + 0.5 * STEP, STEP):
        lattice, points = Loaded(block, replace(springs, b=float(b))), []
        for depth, state, last in zip(depths_mm, states, before, strict=True):
            np.subtract(2.0 * state, last, out=lattice.x)
            lattice.press(depth)
            points.append(settle(lattice))
            last[:], state[:] = state, lattice.x
        yield float(b), points
