"""Conjugate gradients on Hessian-vector products, and the tangent stiffness dR/dd they give.

For the intact branch only: where the Hessian has a negative direction the state is not the one a slow push would keep,
and this says so.
"""

import numpy as np

from rig.errors import RigError
from rig.tissue.lattice.fire import NotConverged
from rig.tissue.lattice.numba_types import Matrix
from rig.tissue.lattice.state import Loaded, aligned_copy

MOST_PRODUCTS = 5_000  # the study's whole block takes some 300


class NegativeCurvature(RigError):
    """The state is not stable: some displacement of the free nodes lowers the energy to second order."""


def solve(lattice: Loaded, right: Matrix, tolerance: float) -> Matrix:
    """Solve H u = ``right`` on the free nodes to ``tolerance`` relative (diagonally preconditioned conjugate
    gradients).

    Raises `NegativeCurvature` at a direction of negative curvature, `NotConverged` after `MOST_PRODUCTS`.
    """
    block, free = lattice.block, lattice.free
    stiff, product = block.allocate(), block.allocate()
    preconditioner = free / np.maximum(lattice.diagonal(stiff), lattice.law.k)
    u, residual = block.allocate(), right * free
    z = preconditioner * residual
    direction = aligned_copy(block, z)
    power, start = float(np.vdot(residual, z)), float(np.linalg.norm(residual))
    if start == 0.0:
        return u
    for _ in range(MOST_PRODUCTS):
        product = lattice.product(direction, product)
        product *= free
        curvature = float(np.vdot(direction, product))
        if curvature <= 0.0:
            raise NegativeCurvature(
                f"at {lattice.depth_mm:.4g} mm the lattice is past a limit point (negative curvature "
                f"{curvature:.3g} N mm): "
                "use the fire solver, smaller depth or the stabilised mode"
            )
        step = power / curvature
        u += step * direction
        residual -= step * product
        if np.linalg.norm(residual) < tolerance * start:
            return u
        z = preconditioner * residual
        power, before = float(np.vdot(residual, z)), power
        direction *= power / before
        direction += z
    raise NotConverged(
        f"conjugate gradients stopped after {MOST_PRODUCTS} products; the state may be near a limit point"
    )


def tangent_stiffness_N_mm(lattice: Loaded, tolerance: float = 1e-7) -> float:
    """dR/dd of a rigid tip at equilibrium: one linear solve for how the free nodes follow the tip."""
    block = lattice.block
    push, out = block.allocate(), block.allocate()
    push[2, lattice.tip] = -1.0
    lattice.product(push, out)
    right, edge = aligned_copy(block, -out), lattice.edge.nodes
    pulled = lattice.edge.follow_N_mm(lattice.x, lattice.depth_mm)
    right[:, edge] += pulled
    follow = solve(lattice, right, tolerance)
    follow += push
    lattice.product(follow, out)
    left = pulled - lattice.edge.tangent_N(lattice.x, lattice.depth_mm, follow[:, edge])
    return float(-block.copies * (np.sum(out[2, lattice.tip]) + np.sum(left[2])))
