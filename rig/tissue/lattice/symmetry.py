"""Does the whole block keep the mirror symmetry that a quarter of it takes for granted?

A quarter cannot leave symmetry, so past a bifurcation its answer is an equilibrium no block would keep. The whole block
is shaken before each depth, which lets it leave.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.sweep import Equilibrium, push

SHAKE = 1e-3  # standard deviation over node spacing


def shaken(
    block: Block, springs: Springs, depths_mm: Sequence[float], generator: np.random.Generator
) -> Iterator[Equilibrium]:
    """Equilibria of the whole block, shaken before each depth; raises NotConverged where it does not settle."""
    lattice = Loaded(replace(block, quarter=False), springs)

    def shake(lattice: Loaded) -> None:
        lattice.x += generator.normal(0.0, SHAKE * block.spacing_mm, lattice.x.shape) * lattice.free

    return push(lattice, depths_mm, shake)
