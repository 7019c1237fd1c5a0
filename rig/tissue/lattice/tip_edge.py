"""The edge of the tip, which runs through the cells of the mesh.

A node's share of the tip is the share of the square around it that the disc covers. Held wholly or not at all, nodes
would make the tip as wide as a staircase happens to be, and its stiffness would jump from mesh to mesh. So a node that
is covered in part is tied to the tip by a spring of its own, from none at share 0 to rigid at share 1, which stiffens
with strain as the others do.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rig.tissue.lattice.numba_types import Floats, Matrix
from rig.tissue.lattice.rows import LARGEST_EXPONENT

if TYPE_CHECKING:
    from rig.tissue.lattice.block import Block
    from rig.tissue.lattice.springs import Springs

Nodes = NDArray[np.int64]
# A tie is this times k w / (1 - w). The limit of fine meshes is the same for 2, 3 and 4; at a spacing of 1/3 of the
# radius the layer's stiffness is missed by 5, 2 and 1 %, and above 3 it no more rises steadily (`benchmarks.mesh`).
TIE = 3.0
# Shares below and above are 0 and 1: a tie of 0.03 k is nothing beside the nine springs of a node at the surface, and
# one of 57 k follows the tip to 2 %, over a twentieth of one node.
LEAST_SHARE, MOST_SHARE = 0.01, 0.95
_GRID = 64  # points a side that a square is sampled at: its share is then right to 0.1 %


def covered_shares(x_mm: Floats, y_mm: Floats, radius_mm: float, spacing_mm: float) -> Floats:
    """Of the square of side ``spacing_mm`` around each (x, y), the share that a disc around the origin covers."""
    inside = ((np.arange(_GRID) + 0.5) / _GRID - 0.5) * spacing_mm
    x, y = (at[:, None, None] for at in (x_mm, y_mm))
    covered = (x + inside[None, :, None]) ** 2 + (y + inside[None, None, :]) ** 2 <= radius_mm**2
    return np.asarray(covered.mean(axis=(1, 2)))


def tie_ratios(shares: Floats) -> Floats:
    """Stiffness of each tie over that of a spring."""
    return np.asarray(TIE * shares / (1.0 - shares))


def rigid_nodes(block: "Block") -> Nodes:
    """Flat indices of the nodes that the tip holds, the middle one, which it always does, first."""
    top, shares = _under_tip(block)
    return np.asarray(top[(shares > MOST_SHARE) | (top == top[0])])


def edge_nodes(block: "Block") -> tuple[Nodes, Floats]:
    """Flat indices of the nodes that it covers in part, and their ties over k, as far as the block stores them."""
    top, shares = _under_tip(block)
    edge = (shares > LEAST_SHARE) & (shares <= MOST_SHARE) & (top != top[0])
    x, y, _ = block.rest()[:, top[edge]]
    stored = np.where(x == 0.0, 0.5, 1.0) * np.where(y == 0.0, 0.5, 1.0) if block.quarter else 1.0
    return top[edge], tie_ratios(shares[edge]) * stored


def _under_tip(block: "Block") -> tuple[Nodes, Floats]:
    """Nodes of the top face, the nearest to the middle first, and the share of each that the tip covers."""
    rest = block.rest()
    on_top = np.zeros(rest.shape, dtype=bool)
    block.inner(on_top)[0, ..., -1] = True
    top = np.flatnonzero(on_top[0])
    x, y, _ = rest[:, top]
    nearest = np.argsort(x**2 + y**2, kind="stable")
    shares = covered_shares(x[nearest], y[nearest], 0.5 * block.tip_diameter_mm, block.spacing_mm)
    return top[nearest], shares


@dataclass(frozen=True)
class TipEdge:
    """Ties of ``nodes`` with ``stiffness`` [N/mm], which hold along ``axes``; T = c exp(b |g|/d) g of the gap g."""

    nodes: Nodes
    stiffness: Floats
    axes: tuple[int, ...]
    b_per_mm: float
    rest: Matrix

    @classmethod
    def of(cls, block: "Block", springs: "Springs") -> "TipEdge":
        """That of the tip on ``block``."""
        nodes, ratios = edge_nodes(block)
        axes = (0, 1, 2) if block.bonded else (2,)
        return cls(nodes, springs.k_N_mm * ratios, axes, springs.b / block.spacing_mm, block.rest()[:, nodes])

    def gap_mm(self, x: Matrix, depth_mm: float) -> Matrix:
        """From each node to where the tip would have it; 0 along directions in which it slides."""
        gap = np.zeros_like(self.rest)
        for axis in self.axes:
            gap[axis] = self.rest[axis] - x[axis, self.nodes]
        gap[2] -= depth_mm
        return gap

    def pull_N(self, x: Matrix, depth_mm: float) -> Matrix:
        """What each tie pulls its node with, shape (3, n)."""
        gap = self.gap_mm(x, depth_mm)
        return np.asarray(self._grown(np.linalg.norm(gap, axis=0)) * gap)

    def tangent_N(self, x: Matrix, depth_mm: float, u: Matrix) -> Matrix:
        """How much more the ties hold back for a small displacement ``u`` (3, n) of their nodes."""
        gap = self.gap_mm(x, depth_mm)
        length = np.linalg.norm(gap, axis=0)
        held = np.zeros_like(u)
        held[list(self.axes)] = u[list(self.axes)]
        along = np.divide(np.sum(gap * held, axis=0), length, out=np.zeros_like(length), where=length > 0.0)
        return np.asarray(self._grown(length) * (held + self.b_per_mm * along * gap))

    def follow_N_mm(self, x: Matrix, depth_mm: float) -> Matrix:
        """What the ties pull more for each mm that the tip sinks."""
        sunk = np.zeros_like(self.rest)
        sunk[2] = -1.0
        return self.tangent_N(x, depth_mm, sunk)

    def bound_N_mm(self, x: Matrix, depth_mm: float) -> Matrix:
        """Bound of the tangent's diagonal."""
        length = np.linalg.norm(self.gap_mm(x, depth_mm), axis=0)
        found = np.zeros_like(self.rest)
        found[list(self.axes)] = self._grown(length) * (1.0 + self.b_per_mm * length)
        return found

    def _grown(self, length_mm: Floats) -> Floats:
        return np.asarray(self.stiffness * np.exp(np.minimum(self.b_per_mm * length_mm, LARGEST_EXPONENT)))
