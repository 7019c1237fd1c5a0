"""Newton's method with conjugate gradients on Hessian-vector products, and the tangent stiffness dR/dd it gives.

For the intact branch only: where the Hessian has a negative direction the state is not the one a slow push would keep,
and this says so.
"""

import numpy as np

from rig.errors import RigError
from rig.tissue.lattice.fire import NotConverged
from rig.tissue.lattice.numba_types import Matrix
from rig.tissue.lattice.state import Loaded, aligned_copy

_LEAST_DAMPING = 1.0 / 64.0  # six halvings; where none helps, the step is taken and solved from anew


class NegativeCurvature(RigError):
    """The state is not stable: some displacement of the free nodes lowers the energy to second order."""


def solve(
    lattice: Loaded, right: Matrix, tolerance: float, truncate: bool = False, most_products: int = 5_000
) -> tuple[Matrix, int]:
    """Solve H u = ``right`` on the free nodes to ``tolerance`` relative (diagonally preconditioned conjugate
    gradients).

    At a direction of negative curvature it raises `NegativeCurvature`, or with ``truncate`` returns the descent made so
    far.
    """
    block, free = lattice.block, lattice.free
    stiff, product = block.allocate(), block.allocate()
    preconditioner = free / np.maximum(lattice.diagonal(stiff), lattice.law.k)
    u, residual = block.allocate(), right * free
    z = preconditioner * residual
    direction = aligned_copy(block, z)
    power, start = float(np.vdot(residual, z)), float(np.linalg.norm(residual))
    if start == 0.0:
        return u, 0
    for count in range(1, most_products + 1):
        product = lattice.product(direction, product)
        product *= free
        curvature = float(np.vdot(direction, product))
        if curvature <= 0.0 and truncate:
            return (u if count > 1 else direction), count
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
            return u, count
        z = preconditioner * residual
        power, before = float(np.vdot(residual, z)), power
        direction *= power / before
        direction += z
    raise NotConverged(
        f"conjugate gradients stopped after {most_products} products; the state may be near a limit point"
    )


def relax(lattice: Loaded, tolerance_N: float, most_steps: int = 60) -> int:
    """Move the free nodes to equilibrium, every force component below ``tolerance_N``; returns the number of Newton
    steps.

    Steps are cut so that no node moves more than half a cell and the norm of the force falls; raises `NotConverged`.
    Whether the state is stable is the question `tangent_stiffness_N_mm` answers.
    """
    lattice.force()
    largest, size = lattice.residual_N(), float(np.linalg.norm(lattice.f * lattice.free))
    for step in range(most_steps):
        if largest < tolerance_N:
            return step
        u, _ = solve(
            lattice,
            aligned_copy(lattice.block, lattice.f),
            min(0.1, np.sqrt(largest / lattice.law.k) * 0.1),
            truncate=True,
        )
        start = aligned_copy(lattice.block, lattice.x)
        damping = min(1.0, 0.5 * lattice.block.spacing_mm / float(np.max(np.abs(u))))
        while True:
            np.add(start, damping * u, out=lattice.x)
            lattice.force()
            new = float(np.linalg.norm(lattice.f * lattice.free))
            if new < size or damping < _LEAST_DAMPING:
                break
            damping *= 0.5
        largest, size = lattice.residual_N(), new
    raise NotConverged(
        f"Newton stopped after {most_steps} steps with {largest:.3g} N left, asked for {tolerance_N:.3g} N; "
        f"load in smaller steps"
    )


def tangent_stiffness_N_mm(lattice: Loaded, tolerance: float = 1e-7) -> float:
    """dR/dd of a rigid tip at equilibrium: one linear solve for how the free nodes follow the tip."""
    block = lattice.block
    push, out = block.allocate(), block.allocate()
    push[2, lattice.tip] = -1.0
    lattice.product(push, out)
    follow, _ = solve(lattice, aligned_copy(block, -out), tolerance)
    follow += push
    lattice.product(follow, out)
    return float(-block.copies * np.sum(out[2, lattice.tip]))
