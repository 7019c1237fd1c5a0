"""Does the whole block keep the mirror symmetry that a quarter of it takes for granted?

A quarter cannot leave symmetry, so past a bifurcation its answer is an equilibrium no block would keep. The whole block
is shaken before each depth, which lets it leave, and its reaction is compared with the quarter's.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.sweep import Equilibrium, push

SHAKE = 1e-3  # standard deviation over node spacing


class Compared(NamedTuple):
    """phi = R/k of the quarter and of the shaken whole block at one depth, and the cells inverted in each."""

    depth_mm: float
    quarter_mm: float
    whole_mm: float
    quarter_inverted: int
    whole_inverted: int

    @property
    def difference(self) -> float:
        """Of the whole from the quarter, relative."""
        return self.whole_mm / self.quarter_mm - 1.0


def shaken(
    block: Block, springs: Springs, depths_mm: Sequence[float], generator: np.random.Generator
) -> Iterator[Equilibrium]:
    """Equilibria of the whole block, shaken before each depth; raises NotConverged where it does not settle."""
    lattice = Loaded(replace(block, quarter=False), springs)

    def shake(lattice: Loaded) -> None:
        lattice.x += generator.normal(0.0, SHAKE * block.spacing_mm, lattice.x.shape) * lattice.free

    return push(lattice, depths_mm, disturb=shake)


def compare(
    block: Block, springs: Springs, depths_mm: Sequence[float], generator: np.random.Generator
) -> Iterator[Compared]:
    """One comparison per depth, in order; raises NotConverged where a block does not settle."""
    quarter = push(Loaded(replace(block, quarter=True), springs), depths_mm)
    k = springs.k_N_mm
    for one, other in zip(quarter, shaken(block, springs, depths_mm, generator), strict=True):
        inverted = one.health.inverted_cells, other.health.inverted_cells
        yield Compared(one.depth_mm, one.reaction_N / k, other.reaction_N / k, *inverted)
