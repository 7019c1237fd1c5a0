"""The block of tissue and the tip that presses it: sizes, boundary conditions, mirror symmetry, storage.

The tip presses along -z on the middle of the top face; the bottom face is bonded to bone. Only the middle node column
makes the block symmetric, so nodes along x and y are odd in number.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.errors import UsageError
from rig.tissue.lattice.kernels import Shape
from rig.tissue.lattice.numba_types import Matrix
from rig.tissue.lattice.rows import FRONT, LONGEST_ROW, PAD
from rig.tissue.lattice.tip_edge import rigid_nodes

_LANES = 8  # float64 values in the widest vector register; rows are padded to a multiple
_MOST_NODES = 4_000_000  # 0.6 GB of state; larger blocks are a slip of the unit more often than a wish


@dataclass(frozen=True)
class Block:
    """A block of ``nodes`` vertices with 18 neighbours each; the defaults are the study's (51 x 51 x 40, 1 mm, 6 mm
    tip).

    ``quarter`` stores x >= 0, y >= 0 only and mirrors the rest. The tip is a rigid disc to which the nodes under it are
    bonded, or along which they slide; of its edge see `tip_edge`. The four lateral faces are held by the tissue around,
    of which the study does not say anything.
    """

    nodes: tuple[int, int, int] = (51, 51, 40)
    spacing_mm: float = 1.0
    tip_diameter_mm: float = 6.0
    quarter: bool = False
    bonded: bool = True

    def __post_init__(self) -> None:
        nx, ny, nz = self.nodes
        if min(nx, ny) < 5 or nz < 3 or nx % 2 == 0 or ny % 2 == 0:
            raise UsageError(
                f"lattice of {nx} x {ny} x {nz} vertices: x and y need an odd number of at least 5 (the tip "
                f"stands on the middle one), "
                "z at least 3; choose for example 51 x 51 x 40"
            )
        if nz > LONGEST_ROW:
            raise UsageError(f"lattice is {nz} vertices deep; the limit is {LONGEST_ROW}: use a wider spacing")
        if nx * ny * nz > _MOST_NODES:
            raise UsageError(
                f"lattice of {nx * ny * nz} vertices is beyond the limit of {_MOST_NODES}; use a wider spacing"
            )
        if not (np.isfinite(self.spacing_mm) and self.spacing_mm > 0.0):
            raise UsageError(f"lattice spacing is {self.spacing_mm} mm; it must be above 0 mm")
        width = (min(nx, ny) - 1) * self.spacing_mm
        if not self.spacing_mm <= self.tip_diameter_mm < width:
            raise UsageError(
                f"tip of {self.tip_diameter_mm} mm does not suit a block {width} mm wide with cells of "
                f"{self.spacing_mm} mm: "
                f"it must be at least one cell and less than the block"
            )

    @property
    def shape(self) -> Shape:
        """Size of what is stored."""
        nx, ny, nz = self.nodes
        if self.quarter:
            nx, ny = (nx + 1) // 2, (ny + 1) // 2
        return Shape(nx, ny, nz, -(-nz // _LANES) * _LANES, 1 if self.quarter else 0)

    @property
    def copies(self) -> int:
        """Whole block over stored block: factor on every force."""
        return 4 if self.quarter else 1

    @property
    def vertices(self) -> int:
        """Vertices of the whole block."""
        return self.nodes[0] * self.nodes[1] * self.nodes[2]

    @property
    def height_mm(self) -> float:
        """Thickness of the tissue over bone."""
        return (self.nodes[2] - 1) * self.spacing_mm

    def as_quarter(self) -> "Block":
        """The same block with mirror symmetry."""
        return replace(self, quarter=True)

    def allocate(self) -> Matrix:
        """Zeros of shape (3, N), rows on 64-byte lines, with room around the nodes for the kernels' reads."""
        shape = self.shape
        used = FRONT + shape.nx * shape.ny * shape.stride + shape.stride + PAD
        length = -(-used // _LANES) * _LANES
        raw = np.zeros(3 * length + _LANES)
        start = (-raw.ctypes.data // raw.itemsize) % _LANES
        return raw[start : start + 3 * length].reshape(3, length)

    def inner(self, flat: Matrix) -> NDArray[np.float64]:
        """View (3, nx, ny, nz) of the nodes inside a flat array."""
        shape = self.shape
        rows = flat[:, FRONT : FRONT + shape.nx * shape.ny * shape.stride]
        return rows.reshape(3, shape.nx, shape.ny, shape.stride)[..., : shape.nz]

    def rest(self) -> Matrix:
        """Positions in mm without load, origin below the tip on the bone. Padding carries the grid on, so no length is
        zero.
        """
        shape, flat = self.shape, self.allocate()
        whole = flat[:, FRONT : FRONT + shape.nx * shape.ny * shape.stride].reshape(3, shape.nx, shape.ny, shape.stride)
        middle = (0, 0) if self.quarter else (shape.nx // 2, shape.ny // 2)
        whole[0] = (np.arange(shape.nx)[:, None, None] - middle[0]) * self.spacing_mm
        whole[1] = (np.arange(shape.ny)[None, :, None] - middle[1]) * self.spacing_mm
        whole[2] = np.arange(shape.stride) * self.spacing_mm
        return flat

    def tip_nodes(self) -> NDArray[np.int64]:
        """Flat indices of the nodes that the tip covers, the middle one first."""
        return rigid_nodes(self)

    def free(self) -> Matrix:
        """1 where a node may move along a direction, 0 where the bone, the tip, a side or a mirror plane holds it."""
        free = self.allocate()
        inner = self.inner(free)
        inner[:] = 1.0
        inner[:, :, :, 0] = 0.0
        inner[:, -1] = 0.0
        inner[:, :, -1] = 0.0
        if self.quarter:
            inner[0, 0] = 0.0
            inner[1, :, 0] = 0.0
        else:
            inner[:, 0] = 0.0
            inner[:, :, 0] = 0.0
        free[(slice(None) if self.bonded else 2), self.tip_nodes()] = 0.0
        return free
