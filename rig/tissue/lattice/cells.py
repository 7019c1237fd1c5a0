"""The volume term of cells: kv/8 sum over corners of (J - 1 - ln J), J = det of the three edges that meet at the
corner.

One determinant per cell lets cells fold over while their mean volume stays positive; one per corner does not. Below
``SMALLEST_CORNER`` the logarithm is continued by a parabola, so that a step too far still finds its way back.

Buffers are one flat array with rows at constant distance ``WIDTH``.
"""

import numpy as np

from rig.tissue.lattice.numba_types import Floats, Matrix, part, row_loop
from rig.tissue.lattice.rows import PAD

WIDTH = 352  # one buffer row: nodes of a few rows and padding on both sides
LONGEST_ROW = WIDTH - 2 * PAD
BUFFER = 24 * WIDTH
SMALLEST_CORNER = 0.002

Vector = tuple[float, float, float]


@part
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@part
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def _sum(p: float, a: Vector, b: Vector) -> Vector:
    return p * (a[0] + b[0]), p * (a[1] + b[1]), p * (a[2] + b[2])


@part
def _corner(a: Vector, b: Vector, c: Vector, kv: float, volume: float) -> tuple[Vector, Vector, Vector]:
    """Pull of one corner along its three edges."""
    g, h, k = _cross(b, c), _cross(c, a), _cross(a, b)
    j = _dot(a, g) / volume
    inside = max(j, SMALLEST_CORNER)
    s = 0.125 * kv / volume * (1.0 - 1.0 / inside + (j - inside) / (SMALLEST_CORNER * SMALLEST_CORNER))
    return (s * g[0], s * g[1], s * g[2]), (s * h[0], s * h[1], s * h[2]), (s * k[0], s * k[1], s * k[2])


@part
def _edge(x: Floats, y: Floats, z: Floats, u: Floats, v: Floats, w: Floats, c: int) -> Vector:
    return u[c] - x[c], v[c] - y[c], w[c] - z[c]


@part
def _rise(x: Floats, y: Floats, z: Floats, c: int) -> Vector:
    return x[c + 1] - x[c], y[c + 1] - y[c], z[c + 1] - z[c]


@part
def _store(out: Floats, node: int, c: int, p: float, a: Vector, q: float, b: Vector, r: float, d: Vector) -> None:
    out[(3 * node) * WIDTH + PAD + c] = p * a[0] + q * b[0] + r * d[0]
    out[(3 * node + 1) * WIDTH + PAD + c] = p * a[1] + q * b[1] + r * d[1]
    out[(3 * node + 2) * WIDTH + PAD + c] = p * a[2] + q * b[2] + r * d[2]


@row_loop
def cell_force(x: Matrix, p: int, s: int, plane: int, n: int, kv: float, volume: float, out: Floats) -> None:
    """Forces on the eight nodes of n cells whose lowest nodes start at ``p``; ``out`` rows 3 (4 i + 2 j + k) +
    component.
    """
    ax, ay, az = x[0][p : p + n + 1], x[1][p : p + n + 1], x[2][p : p + n + 1]
    q = p + s
    bx, by, bz = x[0][q : q + n + 1], x[1][q : q + n + 1], x[2][q : q + n + 1]
    q = p + plane
    cx, cy, cz = x[0][q : q + n + 1], x[1][q : q + n + 1], x[2][q : q + n + 1]
    q = p + plane + s
    dx, dy, dz = x[0][q : q + n + 1], x[1][q : q + n + 1], x[2][q : q + n + 1]
    for c in range(n):
        x00, x10 = _edge(ax, ay, az, cx, cy, cz, c), _edge(bx, by, bz, dx, dy, dz, c)
        x01, x11 = _edge(ax, ay, az, cx, cy, cz, c + 1), _edge(bx, by, bz, dx, dy, dz, c + 1)
        y00, y10 = _edge(ax, ay, az, bx, by, bz, c), _edge(cx, cy, cz, dx, dy, dz, c)
        y01, y11 = _edge(ax, ay, az, bx, by, bz, c + 1), _edge(cx, cy, cz, dx, dy, dz, c + 1)
        z00, z01, z10, z11 = _rise(ax, ay, az, c), _rise(bx, by, bz, c), _rise(cx, cy, cz, c), _rise(dx, dy, dz, c)
        g0, h0, k0 = _corner(x00, y00, z00, kv, volume)
        g1, h1, k1 = _corner(x01, y01, z00, kv, volume)
        g2, h2, k2 = _corner(x10, y00, z01, kv, volume)
        g3, h3, k3 = _corner(x11, y01, z01, kv, volume)
        g4, h4, k4 = _corner(x00, y10, z10, kv, volume)
        g5, h5, k5 = _corner(x01, y11, z10, kv, volume)
        g6, h6, k6 = _corner(x10, y10, z11, kv, volume)
        g7, h7, k7 = _corner(x11, y11, z11, kv, volume)
        gx00, gx01, gx10, gx11 = _sum(1.0, g0, g4), _sum(1.0, g1, g5), _sum(1.0, g2, g6), _sum(1.0, g3, g7)
        gy00, gy01, gy10, gy11 = _sum(1.0, h0, h2), _sum(1.0, h1, h3), _sum(1.0, h4, h6), _sum(1.0, h5, h7)
        gz00, gz01, gz10, gz11 = _sum(1.0, k0, k1), _sum(1.0, k2, k3), _sum(1.0, k4, k5), _sum(1.0, k6, k7)
        _store(out, 0, c, 1.0, gx00, 1.0, gy00, 1.0, gz00)
        _store(out, 1, c, 1.0, gx01, 1.0, gy01, -1.0, gz00)
        _store(out, 2, c, 1.0, gx10, -1.0, gy00, 1.0, gz01)
        _store(out, 3, c, 1.0, gx11, -1.0, gy01, -1.0, gz01)
        _store(out, 4, c, -1.0, gx00, 1.0, gy10, 1.0, gz10)
        _store(out, 5, c, -1.0, gx01, 1.0, gy11, -1.0, gz10)
        _store(out, 6, c, -1.0, gx10, -1.0, gy10, 1.0, gz11)
        _store(out, 7, c, -1.0, gx11, -1.0, gy11, -1.0, gz11)


@part
def _node(x: Matrix, at: int) -> Vector:
    return x[0, at], x[1, at], x[2, at]


@part
def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@part
def _add(out: Floats, node: int, c: int, s: float, a: Vector) -> None:
    out[(3 * node) * WIDTH + PAD + c] += s * a[0]
    out[(3 * node + 1) * WIDTH + PAD + c] += s * a[1]
    out[(3 * node + 2) * WIDTH + PAD + c] += s * a[2]


@row_loop
def cell_second(
    product: bool, x: Matrix, u: Matrix, p: int, s: int, plane: int, n: int, kv: float, volume: float, out: Floats
) -> None:
    """Change of the cell forces along ``u`` (``product``), or a positive bound of the Hessian's diagonal; layout of
    `cell_force`.
    """
    out[:BUFFER] = 0.0
    for corner in range(8):
        i, j, k = corner // 4, corner // 2 % 2, corner % 2
        low = (corner - 4 * i, corner - 2 * j, corner - k)
        at = (p + j * s + k, p + i * plane + k, p + i * plane + j * s)
        for c in range(n):
            a = _minus(_node(x, at[0] + plane + c), _node(x, at[0] + c))
            b = _minus(_node(x, at[1] + s + c), _node(x, at[1] + c))
            d = _minus(_node(x, at[2] + 1 + c), _node(x, at[2] + c))
            g, h, m = _cross(b, d), _cross(d, a), _cross(a, b)
            jacobian = _dot(a, g) / volume
            inside = max(jacobian, SMALLEST_CORNER)
            curve = 0.125 * kv / (inside * inside * volume * volume)
            if product:
                da = _minus(_node(u, at[0] + plane + c), _node(u, at[0] + c))
                db = _minus(_node(u, at[1] + s + c), _node(u, at[1] + c))
                dd = _minus(_node(u, at[2] + 1 + c), _node(u, at[2] + c))
                slope = 0.125 * kv / volume * (1.0 - 1.0 / inside + (jacobian - inside) / SMALLEST_CORNER**2)
                along = curve * (_dot(g, da) + _dot(h, db) + _dot(m, dd))
                dg = _sum(slope, _cross(db, d), _cross(b, dd))
                dh = _sum(slope, _cross(dd, a), _cross(d, da))
                dm = _sum(slope, _cross(da, b), _cross(a, db))
                g = (along * g[0] + dg[0], along * g[1] + dg[1], along * g[2] + dg[2])
                h = (along * h[0] + dh[0], along * h[1] + dh[1], along * h[2] + dh[2])
                m = (along * m[0] + dm[0], along * m[1] + dm[1], along * m[2] + dm[2])
                _add(out, low[0], c, 1.0, g)
                _add(out, low[0] + 4, c, -1.0, g)
                _add(out, low[1], c, 1.0, h)
                _add(out, low[1] + 2, c, -1.0, h)
                _add(out, low[2], c, 1.0, m)
                _add(out, low[2] + 1, c, -1.0, m)
            else:
                total = (
                    abs(g[0]) + abs(h[0]) + abs(m[0]),
                    abs(g[1]) + abs(h[1]) + abs(m[1]),
                    abs(g[2]) + abs(h[2]) + abs(m[2]),
                )
                _add(out, corner, c, curve, (total[0] ** 2, total[1] ** 2, total[2] ** 2))
                _add(out, low[0] + (4 - 4 * i), c, curve, (g[0] ** 2, g[1] ** 2, g[2] ** 2))
                _add(out, low[1] + (2 - 2 * j), c, curve, (h[0] ** 2, h[1] ** 2, h[2] ** 2))
                _add(out, low[2] + (1 - k), c, curve, (m[0] ** 2, m[1] ** 2, m[2] ** 2))


@row_loop
def cell_energy(x: Matrix, p: int, s: int, plane: int, n: int, kv: float, volume: float, out: Floats) -> None:
    """Energy of n cells in N mm, in the first row of ``out``."""
    out[:WIDTH] = 0.0
    for corner in range(8):
        i, j, k = corner // 4, corner // 2 % 2, corner % 2
        at = (p + j * s + k, p + i * plane + k, p + i * plane + j * s)
        for c in range(n):
            a = _minus(_node(x, at[0] + plane + c), _node(x, at[0] + c))
            b = _minus(_node(x, at[1] + s + c), _node(x, at[1] + c))
            d = _minus(_node(x, at[2] + 1 + c), _node(x, at[2] + c))
            jacobian = _dot(a, _cross(b, d)) / volume
            inside = max(jacobian, SMALLEST_CORNER)
            over = jacobian - inside
            value = inside - 1.0 - np.log(inside) + (1.0 - 1.0 / inside) * over + 0.5 * (over / inside) ** 2
            out[PAD + c] += 0.125 * kv * value
