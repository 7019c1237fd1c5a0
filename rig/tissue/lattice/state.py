"""One loaded lattice: positions, forces, reaction of the tip."""

import numpy as np

from rig.tissue.lattice import kernels
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.kernels import Shape
from rig.tissue.lattice.numba_types import Matrix
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.threads import threads

# Below this many nodes a thread takes longer to be woken than to do its share, and much longer on a busy computer.
NODES_A_THREAD = 5_000


def slabs_for(shape: Shape) -> int:
    """Parts worth working on at once."""
    worth = shape.nx * shape.ny * shape.nz // NODES_A_THREAD
    return max(1, min(threads(), shape.nx, worth))


class Loaded:
    """Block, springs and the present positions ``x`` (3, N) in mm; every change of ``x`` is made by a solver."""

    def __init__(self, block: Block, springs: Springs) -> None:
        self.block = block
        self.springs = springs
        self.shape = block.shape
        self.law = springs.for_kernels(block.spacing_mm)
        self.tip = block.tip_nodes()
        self.share = block.multiplicity(self.tip) / block.copies
        self.free = block.free()
        self.rest = block.rest()
        self.x = aligned_copy(block, self.rest)
        self.f = block.allocate()
        self.slabs = slabs_for(self.shape)
        self.load_N = 0.0

    def force(self) -> Matrix:
        """Fill and return the force on every node in N, tip load included."""
        kernels.assemble(kernels.FORCE, self.x, self.x, self.f, self.shape, self.law, self.slabs)
        if self.load_N:
            self.f[2, self.tip] -= self.load_N * self.share / np.sum(self.share) / self.block.copies
        return self.f

    def product(self, u: Matrix, out: Matrix) -> Matrix:
        """Hessian times ``u`` in N."""
        kernels.assemble(kernels.PRODUCT, self.x, u, out, self.shape, self.law, self.slabs)
        np.negative(out, out=out)
        return out

    def diagonal(self, out: Matrix) -> Matrix:
        """Positive bound of the Hessian's diagonal in N/mm."""
        kernels.assemble(kernels.DIAGONAL, self.x, self.x, out, self.shape, self.law, self.slabs)
        return out

    def energy_N_mm(self) -> float:
        """Elastic energy of the whole block."""
        shared = self.block.allocate()
        kernels.assemble(kernels.ENERGY, self.x, self.x, shared, self.shape, self.law, self.slabs)
        return 0.5 * self.block.copies * float(np.sum(shared[0]))

    def press(self, depth_mm: float) -> None:
        """Put the rigid tip at ``depth_mm``; nothing else moves."""
        self.x[2, self.tip] = self.rest[2, self.tip] - depth_mm
        if self.block.contact == "bonded":
            self.x[:2, self.tip] = self.rest[:2, self.tip]

    @property
    def depth_mm(self) -> float:
        """Mean depth of the nodes under the tip."""
        return float(np.average(self.rest[2, self.tip] - self.x[2, self.tip], weights=self.share))

    def reaction_N(self) -> float:
        """Force of the tissue against the tip; call after `force`."""
        if self.block.contact == "pressure":
            return self.load_N
        return float(self.block.copies * np.sum(self.f[2, self.tip]))

    def residual_N(self) -> float:
        """Largest force left on a free node; call after `force`."""
        return float(np.max(np.abs(self.f * self.free)))


def aligned_copy(block: Block, source: Matrix) -> Matrix:
    """A copy that keeps the alignment."""
    out = block.allocate()
    out[:] = source
    return out
