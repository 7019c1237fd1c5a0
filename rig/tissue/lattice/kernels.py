"""Sums over all springs and cells of the lattice: force, Hessian-vector product, Hessian diagonal.

Nine springs start at each node (three edges, six face diagonals), the other nine arrive; eight corners of cells meet at
it. Each thread owns a slab of x planes and computes what reaches into it from the planes beside a second time, so no
two threads write one node. Inside a slab, blocks of rows keep all buffers in the nearest caches.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rig.tissue.lattice import cells, rows
from rig.tissue.lattice.numba_types import Floats, Matrix, RowKernel, driver, piece
from rig.tissue.lattice.rows import FRONT, MASKS, PAD, WIDTH, ZEROS
from rig.tissue.lattice.threads import cut, in_parts

SPRING_NODES, CELL_NODES = 320, 160  # of a block of rows: its buffers then stay in the nearest caches
_BUFFER = (ZEROS + 1) * WIDTH
_MASKS = 4 * MASKS * WIDTH

# Steps along x, y, z of the nine directions; near ends are summed in this order. Rows 0-3 stay in the plane, 4-8 go
# to the next one.
STEPS = np.array(
    [[0, 0, 1], [0, 1, 0], [0, 1, 1], [0, 1, -1], [1, 0, 0], [1, 0, 1], [1, 0, -1], [1, 1, 0], [1, -1, 0]],
    dtype=np.int64,
)


class Shape(NamedTuple):
    """Size of the stored block: nodes along x, y, z, row stride in z, and 1 if x = 0 and y = 0 are mirror planes."""

    nx: int
    ny: int
    nz: int
    stride: int
    mirrored: int


class Stiffness(NamedTuple):
    """Spring stiffness k in N/mm, exponent b (0: constant), cell-volume stiffness in N mm, node spacing in mm."""

    k: float
    b: float
    cell: float
    spacing: float


class Sum(NamedTuple):
    """What to sum: kernels for springs of constant and of growing stiffness and for cells; the sign at far ends."""

    constant: Callable[[], RowKernel]
    exponential: Callable[[], RowKernel]
    cell: Callable[[], RowKernel]
    far: float


FORCE = Sum(rows.constant_force, rows.exponential_force, cells.cell_force, -1.0)
PRODUCT = Sum(rows.spring_product, rows.spring_product, cells.cell_product, -1.0)
DIAGONAL = Sum(rows.spring_diagonal, rows.spring_diagonal, cells.cell_diagonal, 1.0)


@piece
def _at(row: int) -> int:
    return row * WIDTH + PAD


@piece
def _masks_of(shape: Shape, j: int, count: int) -> int:
    """Where the set of masks for rows j ... j+count-1 of a plane starts; only first and last rows are special."""
    special = (1 if j == 0 else 0) + (2 if j + count == shape.ny else 0)
    return _at(MASKS * special)


@piece
def _fill_masks(masks: Floats, shape: Shape, most: int) -> None:
    """Masks of all sets that blocks of ``most`` rows need; springs in the mirror plane y = 0 count half."""
    for j in range(0, shape.ny, most):
        count = min(most, shape.ny - j)
        if j <= most or j + count == shape.ny:
            for row in range(MASKS):
                _fill_mask(masks, shape, j, count, row // 3 - 1, row % 3 - 1, _masks_of(shape, j, count) + row * WIDTH)


@piece
def _fill_mask(masks: Floats, shape: Shape, j: int, count: int, dj: int, dk: int, at: int) -> None:
    for y in range(j, j + count):
        weight = 0.5 if shape.mirrored == 1 and y == 0 and dj == 0 else 1.0
        for z in range(shape.stride):
            inside = z < shape.nz and 0 <= z + dk < shape.nz and 0 <= y + dj < shape.ny
            masks[at + (y - j) * shape.stride + z] = weight if inside else 0.0


@driver
def _springs(
    spring: RowKernel, add: RowKernel, far: float, x: Matrix, u: Matrix, f: Matrix,
    shape: Shape, law: Stiffness, first: int, stop: int, t: Floats, masks: Floats,
) -> None:  # fmt: skip
    """All springs that act on planes first ... stop-1."""
    s, plane, most = shape.stride, shape.ny * shape.stride, max(1, SPRING_NODES // shape.stride)
    _fill_masks(masks, shape, most)
    for i in range(max(first - 1, 0), stop):
        own, own_next, last_plane = i >= first, first <= i + 1 < stop, i + 1 == shape.nx
        for j in range(0, shape.ny, most):
            count = min(most, shape.ny - j)
            m = _masks_of(shape, j, count)
            p = FRONT + i * plane + j * s
            for d in range(9):
                di, dj, dk = STEPS[d, 0], STEPS[d, 1], STEPS[d, 2]
                if (di == 1 and not last_plane) or (di == 0 and own):
                    length = law.spacing if d in (0, 1, 4) else law.spacing * np.sqrt(2.0)
                    k = 0.5 * law.k if shape.mirrored == 1 and i == 0 and di == 0 else law.k
                    q = p + di * plane + dj * s + dk
                    mask = m + (3 * dj + dk + 4) * WIDTH
                    spring(x, u, p, q, count * s, k, length, law.b, t, _at(3 * d), masks, mask)
            _scatter(add, f, shape, p, count * s, own, own_next, last_plane, j == 0, j + count == shape.ny, far, t)


@piece
def _scatter(
    add: RowKernel, f: Matrix, shape: Shape, p: int, n: int, own: bool,
    own_next: bool, last_plane: bool, lowest: bool, highest: bool, far: float, t: Floats,
) -> None:  # fmt: skip
    """Add the buffers of nine directions to both ends; ``far`` is the sign at the far end.

    ``lowest`` and ``highest`` rows of a plane have no neighbour below and above. Adding their zeros would write to the
    planes beside, where another thread may be adding: its sum would be lost.
    """
    s, q = shape.stride, p + shape.ny * shape.stride
    up = n - s if highest else n
    down = s if lowest else 0
    nil = _at(ZEROS)
    for w in range(3):
        t0, t1, t2 = _at(w), _at(3 + w), _at(6 + w)
        t3, t4, t5 = _at(9 + w), _at(12 + w), _at(15 + w)
        t6, t7, t8 = _at(18 + w), _at(21 + w), _at(24 + w)
        if own:
            add(f, w, p, n, t, t0, t1, t2, 1.0)
            add(f, w, p, n, t, t0 - 1, nil, nil, far)
            add(f, w, p + s, up, t, t1, t2 - 1, t3 + 1, far)
        if own and last_plane:
            add(f, w, p, n, t, t3, nil, nil, 1.0)
        elif own:
            add(f, w, p, n, t, t3, t4, t5, 1.0)
            add(f, w, p, n, t, t6, t7, t8, 1.0)
        if own_next:
            add(f, w, q, n, t, t4, t5 - 1, t6 + 1, far)
            add(f, w, q + s, up, t, t7, nil, nil, far)
            add(f, w, q - s + down, n - down, t, t8 + down, nil, nil, far)


@driver
def _cells(
    cell: RowKernel, add: RowKernel, x: Matrix, u: Matrix, f: Matrix,
    shape: Shape, law: Stiffness, first: int, stop: int, t: Floats, masks: Floats,
) -> None:  # fmt: skip
    """All corners of cells that act on planes first ... stop-1."""
    s, plane, most = shape.stride, shape.ny * shape.stride, max(1, CELL_NODES // shape.stride)
    nil = _at(ZEROS)
    _fill_masks(masks, shape, most)
    for i in range(max(first - 1, 0), min(stop + 1, shape.nx)):
        for j in range(0, shape.ny, most):
            count = min(most, shape.ny - j)
            n = count * s
            up = n - s if j + count == shape.ny else n
            down = s if j == 0 else 0
            p = FRONT + i * plane + j * s
            low, kv_low = (p - plane, law.cell) if i > 0 else (p, 0.0)
            high, kv_high = (p + plane, law.cell) if i + 1 < shape.nx else (p, 0.0)
            cell(x, u, p, low, high, s, n, kv_low, kv_high, law.spacing**3, t, masks, _masks_of(shape, j, count))
            for w in range(3):
                r = _at(w)
                if first <= i < stop:
                    add(f, w, p, n, t, r, r + 15 * WIDTH + 1, r + 18 * WIDTH - 1, 1.0)
                    add(f, w, p - s + down, n - down, t, r + 9 * WIDTH + down, nil, nil, 1.0)
                    add(f, w, p + s, up, t, r + 12 * WIDTH, nil, nil, 1.0)
                if first < i <= stop:
                    add(f, w, low, n, t, r + 3 * WIDTH, nil, nil, 1.0)
                if first <= i + 1 < stop:
                    add(f, w, high, n, t, r + 6 * WIDTH, nil, nil, 1.0)


def _slab(what: Sum, x: Matrix, u: Matrix, f: Matrix, shape: Shape, law: Stiffness, first: int, stop: int) -> None:
    """Everything that acts on planes first ... stop-1."""
    plane, add = shape.ny * shape.stride, rows.add_three()
    f[:, FRONT + first * plane : FRONT + stop * plane] = 0.0
    spring = what.constant() if law.b == 0.0 else what.exponential()
    _springs(spring, add, what.far, x, u, f, shape, law, first, stop, np.zeros(_BUFFER), np.zeros(_MASKS))
    if law.cell > 0.0:
        _cells(what.cell(), add, x, u, f, shape, law, first, stop, np.zeros(_BUFFER), np.zeros(_MASKS))


def assemble(what: Sum, x: Matrix, u: Matrix, f: Matrix, shape: Shape, law: Stiffness, slabs: int) -> None:
    """Fill ``f`` (3, N): force in N, or minus Hessian times ``u``, or a positive bound of the Hessian's diagonal in
    N/mm.

    A mirrored block holds a quarter: nodes on one mirror plane carry half their springs, the corner line a quarter, so
    forces are a quarter of the whole.
    """
    in_parts(_slab, [(what, x, u, f, shape, law, first, stop) for first, stop in cut(shape.nx, slabs)])
