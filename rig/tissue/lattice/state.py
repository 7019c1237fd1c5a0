"""One loaded lattice: positions, forces, reaction of the tip."""

import numpy as np

from rig.tissue.lattice import kernels
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.kernels import Shape
from rig.tissue.lattice.numba_types import Matrix
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.threads import threads
from rig.tissue.lattice.tip_edge import TipEdge

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
        self.shape = block.shape
        self.take(springs)
        self.tip = block.tip_nodes()
        self.depth_mm = 0.0
        self.free = block.free()
        self.rest = block.rest()
        self.x = aligned_copy(block, self.rest)
        self.f = block.allocate()
        self.slabs = slabs_for(self.shape)

    def take(self, springs: Springs) -> None:
        """Put other springs into every place."""
        self.springs, self.law = springs, springs.for_kernels(self.block.spacing_mm)
        self.edge = TipEdge.of(self.block, springs)

    def force(self) -> Matrix:
        """Fill and return the force on every node in N."""
        kernels.assemble(kernels.FORCE, self.x, self.x, self.f, self.shape, self.law, self.slabs)
        self.f[:, self.edge.nodes] += self.edge.pull_N(self.x, self.depth_mm)
        return self.f

    def product(self, u: Matrix, out: Matrix) -> Matrix:
        """Hessian times ``u`` in N."""
        kernels.assemble(kernels.PRODUCT, self.x, u, out, self.shape, self.law, self.slabs)
        np.negative(out, out=out)
        out[:, self.edge.nodes] += self.edge.tangent_N(self.x, self.depth_mm, u[:, self.edge.nodes])
        return out

    def diagonal(self, out: Matrix) -> Matrix:
        """Positive bound of the Hessian's diagonal in N/mm."""
        kernels.assemble(kernels.DIAGONAL, self.x, self.x, out, self.shape, self.law, self.slabs)
        out[:, self.edge.nodes] += self.edge.bound_N_mm(self.x, self.depth_mm)
        return out

    def press(self, depth_mm: float) -> None:
        """Put the rigid tip at ``depth_mm``; nothing else moves."""
        held = slice(None) if self.block.bonded else slice(2, None)
        self.x[held, self.tip] = self.rest[held, self.tip]
        self.x[2, self.tip] -= depth_mm
        self.depth_mm = float(depth_mm)

    def reaction_N(self) -> float:
        """Force of the tissue against the tip and its edge; call after `force`."""
        edge = np.sum(self.edge.pull_N(self.x, self.depth_mm)[2])
        return float(self.block.copies * (np.sum(self.f[2, self.tip]) - edge))


def aligned_copy(block: Block, source: Matrix) -> Matrix:
    """A copy that keeps the alignment."""
    out = block.allocate()
    out[:] = source
    return out
