"""Sums over all springs and cells of the lattice: force, Hessian-vector product, Hessian diagonal, energy.

Nine springs start at each node (three edges, six face diagonals), the other nine arrive. Each thread owns a slab of x
planes and computes the springs that cross into it from below a second time, so no two threads write one node. Inside a
slab, blocks of ``ROWS`` rows keep all buffers in the first cache level.
"""

from typing import NamedTuple

import numpy as np

from rig.tissue.lattice import cells, rows
from rig.tissue.lattice.numba_types import Floats, Matrix, driver
from rig.tissue.lattice.rows import PAD
from rig.tissue.lattice.threads import cut, in_parts

ROWS = 8
CELL_NODES = 80  # nodes per block of cells: 24 buffer rows of this length stay in the first cache level
FORCE, PRODUCT, DIAGONAL, ENERGY = 0, 1, 2, 3

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


@driver
def _spring_row(
    op: int, x: Matrix, u: Matrix, p: int, q: int, n: int, k: float, length: float, b: float, t: Matrix
) -> None:
    if op == FORCE:
        if b == 0.0:
            rows.constant_force(x, p, q, n, k, length, t)
        else:
            rows.exponential_force(x, p, q, n, k, length, b, t)
    elif op == PRODUCT:
        rows.spring_product(x, u, p, q, n, k, length, b, t)
    elif op == DIAGONAL:
        rows.spring_diagonal(x, p, q, n, k, length, b, t)
    else:
        rows.spring_energy(x, p, q, n, k, length, b, t)


@driver
def _scale(t: Matrix, components: int, start: int, stop: int, factor: float) -> None:
    for w in range(components):
        row = t[w][PAD + start : PAD + stop]
        for c in range(stop - start):
            row[c] = row[c] * factor if factor > 0.0 else 0.0


@driver
def _trim(t: Matrix, components: int, shape: Shape, j: int, count: int, dj: int, dk: int) -> None:
    """Zero the springs of a block that leave it in y or z; halve those that lie in the mirror plane y = 0."""
    s = shape.stride
    for row in range(count):
        if dk < 0:
            _scale(t, components, row * s, row * s + 1, 0.0)
        top = shape.nz - 1 if dk > 0 else shape.nz
        if top < s:
            _scale(t, components, row * s + top, row * s + s, 0.0)
    if dj > 0 and j + count == shape.ny:
        _scale(t, components, (count - 1) * s, count * s, 0.0)
    if dj < 0 and j == 0:
        _scale(t, components, 0, s, 0.0)
    if dj == 0 and j == 0 and shape.mirrored == 1:
        _scale(t, components, 0, s, 0.5)


@driver
def _total(row: Floats, n: int) -> float:
    values = row[PAD : PAD + n]
    total = 0.0
    for c in range(n):
        total += values[c]
    return total


@driver
def _springs(
    op: int,
    x: Matrix,
    u: Matrix,
    f: Matrix,
    shape: Shape,
    law: Stiffness,
    i: int,
    j: int,
    count: int,
    own: bool,
    own_next: bool,
    t: Floats,
) -> float:
    """All springs that start in rows j ... j+count-1 of plane i; returns their energy if asked for it."""
    s, n = shape.stride, count * shape.stride
    p = PAD + (i * shape.ny + j) * s
    components = 1 if op == ENERGY else 3
    last_plane = i + 1 == shape.nx
    total = 0.0
    for d in range(9):
        di, dj, dk = STEPS[d, 0], STEPS[d, 1], STEPS[d, 2]
        if (di == 0 and not own) or (di == 1 and last_plane):
            continue
        length = law.spacing if d in (0, 1, 4) else law.spacing * np.sqrt(2.0)
        k = 0.5 * law.k if shape.mirrored == 1 and i == 0 and di == 0 else law.k
        _spring_row(op, x, u, p, p + (di * shape.ny + dj) * s + dk, n, k, length, law.b, t[d])
        _trim(t[d], components, shape, j, count, dj, dk)
        if op == ENERGY and own:
            total += _total(t[d, 0], n)
    if op != ENERGY:
        far = -1.0 if op != DIAGONAL else 1.0
        _scatter_springs(f, shape, p, n, own, own_next, last_plane, j == 0, j + count == shape.ny, far, t)
    return total


@driver
def _scatter_springs(
    f: Matrix,
    shape: Shape,
    p: int,
    n: int,
    own: bool,
    own_next: bool,
    last_plane: bool,
    lowest: bool,
    highest: bool,
    far: float,
    t: Floats,
) -> None:
    """Add the buffers of nine directions to both ends; ``far`` is the sign at the far end.

    ``lowest`` and ``highest`` rows of a plane have no neighbour below and above. Adding their zeros would write to the
    planes beside, where another thread may be adding: its sum would be lost.
    """
    s, q = shape.stride, p + shape.ny * shape.stride
    up = n - s if highest else n
    down = s if lowest else 0
    for w in range(3):
        fw = f[w]
        if own:
            rows.add_own(fw, p, n, t[1, w], far, t[0, w])
            rows.add_sum(fw, p, n, t[0, w], t[2, w], t[3, w], t[9, w])
            rows.add_far(fw, p + s, up, t[1, w], t[2, w], t[3, w], far)
            if not last_plane:
                rows.add_sum(fw, p, n, t[4, w], t[5, w], t[6, w], t[7, w])
                rows.add_level(fw, p, n, t[8, w], 1.0)
        if own_next:
            rows.add_far(fw, q, n, t[4, w], t[5, w], t[6, w], far)
            rows.add_level(fw, q + s, up, t[7, w], far)
            rows.add_level(fw, q - s + down, n - down, t[8, w][down:], far)


@driver
def _cells(
    op: int,
    x: Matrix,
    u: Matrix,
    f: Matrix,
    shape: Shape,
    law: Stiffness,
    i: int,
    j: int,
    count: int,
    own: bool,
    own_next: bool,
    t: Floats,
) -> float:
    """All cells whose lowest corner lies in rows j ... j+count-1 of plane i; returns their energy if asked for it."""
    s, plane, n = shape.stride, shape.ny * shape.stride, count * shape.stride
    p = PAD + (i * shape.ny + j) * s
    volume = law.spacing**3
    if op == FORCE:
        cells.cell_force(x, p, s, plane, n, law.cell, volume, t)
    elif op == ENERGY:
        cells.cell_energy(x, p, s, plane, n, law.cell, volume, t)
    else:
        cells.cell_second(op == PRODUCT, x, u, p, s, plane, n, law.cell, volume, t)
    rows_of_t = t.reshape((24, cells.WIDTH))
    for row in range(count):
        _scale(rows_of_t, 24, row * s + shape.nz - 1, row * s + s, 0.0)
    if op == ENERGY:
        return _total(t, n) if own else 0.0
    for column in range(4):
        if own if column < 2 else own_next:
            q = p + column // 2 * plane + column % 2 * s
            for w in range(3):
                rows.add_own(f[w], q, n, rows_of_t[6 * column + w], 1.0, rows_of_t[6 * column + 3 + w])
    return 0.0


@driver
def _slab(op: int, x: Matrix, u: Matrix, f: Matrix, shape: Shape, law: Stiffness, first: int, stop: int) -> float:
    """Everything that acts on planes first ... stop-1."""
    t = np.zeros((10, 3, shape.stride * ROWS + 2 * PAD))
    corners = np.zeros(cells.BUFFER)
    cell_rows = max(1, CELL_NODES // shape.stride)
    total = 0.0
    plane = shape.ny * shape.stride
    for w in range(0 if op == ENERGY else 3):
        out = f[w][PAD + first * plane : PAD + stop * plane]
        for c in range((stop - first) * plane):
            out[c] = 0.0
    for i in range(max(first - 1, 0), stop):
        own, own_next = i >= first, first <= i + 1 < stop
        for j in range(0, shape.ny, ROWS):
            total += _springs(op, x, u, f, shape, law, i, j, min(ROWS, shape.ny - j), own, own_next, t)
        if law.cell > 0.0 and i + 1 < shape.nx:
            for j in range(0, shape.ny - 1, cell_rows):
                total += _cells(op, x, u, f, shape, law, i, j, min(cell_rows, shape.ny - 1 - j), own, own_next, corners)
    return total


def assemble(op: int, x: Matrix, u: Matrix, f: Matrix, shape: Shape, law: Stiffness, slabs: int) -> float:
    """Fill ``f`` (3, N): force in N, or minus Hessian times ``u``, or a positive bound of the Hessian's diagonal in
    N/mm; with ``ENERGY`` leave it and return the energy in N mm.

    A mirrored block holds a quarter: nodes on one mirror plane carry half their springs, the corner line a quarter, so
    forces and energy are a quarter of the whole.
    """
    return sum(in_parts(_slab, [(op, x, u, f, shape, law, first, stop) for first, stop in cut(shape.nx, slabs)]))
