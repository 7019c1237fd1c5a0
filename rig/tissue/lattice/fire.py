"""The default solver: FIRE relaxation with masses scaled to the local stiffness.

Masses are the Hessian's diagonal, so every part of the block is moved at its own largest stable pace whatever k is.
"""

import numpy as np

from rig.errors import RigError
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.steps import fire_step

REFRESH_STEPS = 20
LARGEST_STEP_MM = 0.05  # of cells of 1 mm: the force of springs with b = 13 then doubles at most
LARGEST_PSEUDO_STEP = 1.0  # masses equal the diagonal stiffness: up to 1.4 is stable (Gershgorin)


class NotConverged(RigError):
    """A solver ran out of steps or out of numbers; the message says where it stood."""


def relax(lattice: Loaded, tolerance_N: float, most_steps: int = 20_000) -> int:
    """Move the free nodes to equilibrium: every force component below ``tolerance_N``. Returns the number of steps.

    Raises `NotConverged`.
    """
    block = lattice.block
    v, inverse_mass = block.allocate(), block.allocate()
    control = np.array([0.3 * LARGEST_PSEUDO_STEP, 0.1, 0.0, LARGEST_PSEUDO_STEP])
    stiff = block.allocate()
    cap = LARGEST_STEP_MM * block.spacing_mm
    x, flat_v, flat_m = lattice.x.reshape(-1), v.reshape(-1), inverse_mass.reshape(-1)
    largest = np.inf
    for step in range(most_steps):
        if step % REFRESH_STEPS == 0:
            np.maximum(lattice.diagonal(stiff), lattice.law.k, out=stiff)
            np.divide(lattice.free, stiff, out=inverse_mass)
        f = lattice.force()
        largest = fire_step(x, flat_v, f.reshape(-1), flat_m, control, cap, lattice.slabs)
        if largest < tolerance_N:
            lattice.force()
            return step + 1
        if not np.isfinite(largest):
            raise NotConverged(f"FIRE met a force that is not a number at step {step}; load in smaller steps")
    raise NotConverged(
        f"FIRE stopped after {most_steps} steps with {largest:.3g} N left on one node, asked for {tolerance_N:.3g} N; "
        "load in smaller steps or allow a larger force"
    )
