"""The volume term of cells: kv/8 sum over corners of (J - 1 - ln J), J = det of the three edges that meet at the
corner.

One determinant per cell lets cells fold over while their mean volume stays positive; one per corner does not. Below
``SMALLEST_CORNER`` the logarithm is continued by a parabola, so that a step too far still finds its way back.

Kernels go from node to node: eight corners meet at a node, one per octant, and share the six edges that leave it
(a along x, b along y, d along z; the first of a pair goes down, the second up). Results go to seven times three buffer
rows: what the node itself gets, then its neighbours in the order of the edges. The masks from ``m`` on say which
octants hold a cell; ``low`` and ``high`` are the rows of the planes beside, with stiffness 0 where there is none.
"""

from rig.tissue.lattice.numba_types import CELL, Floats, Matrix, part, row_kernel
from rig.tissue.lattice.rows import PAD, WIDTH, Vector, at, between, dot, store

# Down to 11 mm no corner of the study's block is below 0.007: what is smaller is on its way, not at rest.
SMALLEST_CORNER = 0.002
_PARABOLA = 1.0 / SMALLEST_CORNER**2

Quad = tuple[float, float, float, float]
Vectors = tuple[Vector, Vector, Vector, Vector]
Corner = tuple[int, int, int, float, float, int, int, int, int]

_M1, _M2, _M3 = 2 * WIDTH, 6 * WIDTH, 8 * WIDTH  # masks of the octants (-,+), (+,-), (+,+) after that of (-,-)
_OWN, _AL, _AH, _BL, _BH, _DL, _DH = (3 * row * WIDTH + PAD for row in range(7))


@part
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@part
def _sum(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@part
def _slope(j: float) -> float:
    """Derivative of J - 1 - ln J, continued."""
    inside = max(j, SMALLEST_CORNER)
    return 1.0 - 1.0 / inside + (j - inside) * _PARABOLA


@part
def _curvature(j: float) -> float:
    inside = max(j, SMALLEST_CORNER)
    return 1.0 / (inside * inside)


@part
def _crosses(al: Vector, ah: Vector, bl: Vector, bh: Vector) -> Vectors:
    return _cross(al, bl), _cross(al, bh), _cross(ah, bl), _cross(ah, bh)


@part
def _pulls(a: Vector, areas: Vectors, s: float, kv: float, mask: Quad) -> Quad:
    """Slopes of the four octants along one edge, times stiffness and handedness; ``s`` is +-1/volume."""
    return (
        kv * mask[0] * _slope(s * dot(a, areas[0])),
        -kv * mask[1] * _slope(-s * dot(a, areas[1])),
        -kv * mask[2] * _slope(-s * dot(a, areas[2])),
        kv * mask[3] * _slope(s * dot(a, areas[3])),
    )


@part
def _weighted(s: float, t: float, u: float, v: float, a: Vectors) -> Vector:
    return (
        s * a[0][0] + t * a[1][0] + u * a[2][0] + v * a[3][0],
        s * a[0][1] + t * a[1][1] + u * a[2][1] + v * a[3][1],
        s * a[0][2] + t * a[1][2] + u * a[2][2] + v * a[3][2],
    )


@row_kernel(CELL)
def cell_force(
    x: Matrix, _u: Matrix, p: int, low: int, high: int, stride: int, n: int,
    kv_low: float, kv_high: float, volume: float, t: Floats, masks: Floats, m: int,
) -> None:  # fmt: skip
    """Forces in N. The determinant of an octant with an odd number of edges that go down is -J."""
    inverse = 1.0 / volume
    weak, strong = 0.125 * kv_low * inverse, 0.125 * kv_high * inverse
    for c in range(n):
        o = p + c
        al, ah = between(x, o, low + c), between(x, o, high + c)
        bl, bh = between(x, o, o - stride), between(x, o, o + stride)
        dl, dh = between(x, o, o - 1), between(x, o, o + 1)
        of_a, of_b, of_d = _crosses(bl, bh, dl, dh), _crosses(dl, dh, al, ah), _crosses(al, ah, bl, bh)
        mask = masks[at(m + c)], masks[at(m + _M1 + c)], masks[at(m + _M2 + c)], masks[at(m + _M3 + c)]
        s, h = _pulls(al, of_a, -inverse, -weak, mask), _pulls(ah, of_a, inverse, strong, mask)
        fal, fah = _weighted(s[0], s[1], s[2], s[3], of_a), _weighted(h[0], h[1], h[2], h[3], of_a)
        fbl, fbh = _weighted(s[0], h[0], s[1], h[1], of_b), _weighted(s[2], h[2], s[3], h[3], of_b)
        fdl, fdh = _weighted(s[0], s[2], h[0], h[2], of_d), _weighted(s[1], s[3], h[1], h[3], of_d)
        store(t, _OWN + c, 1.0, _sum(_sum(_sum(fal, fah), _sum(fbl, fbh)), _sum(fdl, fdh)))
        store(t, _AL + c, -1.0, fal)
        store(t, _AH + c, -1.0, fah)
        store(t, _BL + c, -1.0, fbl)
        store(t, _BH + c, -1.0, fbh)
        store(t, _DL + c, -1.0, fdl)
        store(t, _DH + c, -1.0, fdh)


@part
def _corner(
    octant: int, p: int, low: int, high: int, stride: int, kv_low: float, kv_high: float, volume: float
) -> Corner:
    """Where the edges of an octant end, +-1/volume, kv/8, its mask in a set, and the rows of its three edges."""
    i, j, k = octant // 4, octant // 2 % 2, octant % 2
    a = high if i == 1 else low
    b = p + stride if j == 1 else p - stride
    d = p + 1 if k == 1 else p - 1
    sign = 1.0 if (i + j + k) % 2 == 1 else -1.0
    kv = 0.125 * (kv_high if i == 1 else kv_low)
    return a, b, d, sign / volume, kv, (6 * j + 2 * k) * WIDTH, _row(3 + 3 * i), _row(9 + 3 * j), _row(15 + 3 * k)


@part
def _row(number: int) -> int:
    return number * WIDTH + PAD


@part
def _clear(t: Floats, n: int) -> None:
    for number in range(21):
        row = _row(number)
        for c in range(n):
            t[at(row + c)] = 0.0


@part
def _add(t: Floats, row: int, s: float, a: Vector) -> None:
    t[at(row)] += s * a[0]
    t[at(row + WIDTH)] += s * a[1]
    t[at(row + 2 * WIDTH)] += s * a[2]


@part
def _along(s: float, a: Vector, t: float, b: Vector, c: Vector) -> Vector:
    """s a + t (b + c)."""
    return s * a[0] + t * (b[0] + c[0]), s * a[1] + t * (b[1] + c[1]), s * a[2] + t * (b[2] + c[2])


@row_kernel(CELL)
def cell_product(
    x: Matrix, u: Matrix, p: int, low: int, high: int, stride: int, n: int,
    kv_low: float, kv_high: float, volume: float, t: Floats, masks: Floats, m: int,
) -> None:  # fmt: skip
    """Change of the forces for a small displacement u."""
    _clear(t, n)
    for octant in range(8):
        ea, eb, ed, s, kv, octant_mask, ra, rb, rd = _corner(octant, p, low, high, stride, kv_low, kv_high, volume)
        for c in range(n):
            o = p + c
            a, b, d = between(x, o, ea + c), between(x, o, eb + c), between(x, o, ed + c)
            da, db, dd = between(u, o, ea + c), between(u, o, eb + c), between(u, o, ed + c)
            ga, gb, gd = _cross(b, d), _cross(d, a), _cross(a, b)
            j, weight = s * dot(a, ga), masks[at(m + octant_mask + c)] * kv * s
            slope = weight * _slope(j)
            curve = weight * s * _curvature(j) * (dot(ga, da) + dot(gb, db) + dot(gd, dd))
            fa = _along(curve, ga, slope, _cross(db, d), _cross(b, dd))
            fb = _along(curve, gb, slope, _cross(dd, a), _cross(d, da))
            fd = _along(curve, gd, slope, _cross(da, b), _cross(a, db))
            _add(t, _OWN + c, 1.0, _sum(_sum(fa, fb), fd))
            _add(t, ra + c, -1.0, fa)
            _add(t, rb + c, -1.0, fb)
            _add(t, rd + c, -1.0, fd)


@part
def _squares(a: Vector) -> Vector:
    return a[0] * a[0], a[1] * a[1], a[2] * a[2]


@part
def _sizes(a: Vector, b: Vector, c: Vector) -> Vector:
    return abs(a[0]) + abs(b[0]) + abs(c[0]), abs(a[1]) + abs(b[1]) + abs(c[1]), abs(a[2]) + abs(b[2]) + abs(c[2])


@row_kernel(CELL)
def cell_diagonal(
    x: Matrix, _u: Matrix, p: int, low: int, high: int, stride: int, n: int,
    kv_low: float, kv_high: float, volume: float, t: Floats, masks: Floats, m: int,
) -> None:  # fmt: skip
    """A positive bound of the Hessian's diagonal."""
    _clear(t, n)
    for octant in range(8):
        ea, eb, ed, s, kv, octant_mask, ra, rb, rd = _corner(octant, p, low, high, stride, kv_low, kv_high, volume)
        for c in range(n):
            o = p + c
            a, b, d = between(x, o, ea + c), between(x, o, eb + c), between(x, o, ed + c)
            ga, gb, gd = _cross(b, d), _cross(d, a), _cross(a, b)
            curve = masks[at(m + octant_mask + c)] * kv * s * s * _curvature(s * dot(a, ga))
            _add(t, _OWN + c, curve, _squares(_sizes(ga, gb, gd)))
            _add(t, ra + c, curve, _squares(ga))
            _add(t, rb + c, curve, _squares(gb))
            _add(t, rd + c, curve, _squares(gd))
