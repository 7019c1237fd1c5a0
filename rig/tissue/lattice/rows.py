"""Inner loops over rows of springs; everything here is vectorised by the compiler.

A row is ``n`` consecutive nodes of the flat arrays. Results go to short buffers with ``PAD`` zeros on both sides, so
that the scatter passes can read their neighbours in z without a branch. Arrays are sliced before each loop: numba then
knows that indices are not negative and emits plain vector loads instead of gathers.
"""

import numpy as np

from rig.tissue.lattice.numba_types import Floats, Matrix, inlined, row_loop

PAD = 8
TINY = 1e-24  # mm^2; two nodes that meet exactly then pull with no force instead of with one that is not a number
LARGEST_EXPONENT = 300.0  # exp(300) is a failed step, not a spring; keeps infinities out of the sums


@inlined
def vector_exp(x: float) -> float:
    """exp(x) for |x| < 700 to 1e-15 relative: reduction by ln 2 and a degree-11 Taylor polynomial (Estrin's order).

    The library call is scalar, and one scalar call keeps the whole loop from being vectorised.
    """
    shifted = x * 1.4426950408889634 + 6755399441055744.0
    n = shifted - 6755399441055744.0
    r = (x - n * 0.6931471803691238) - n * 1.9082149292705877e-10
    r2 = r * r
    r4 = r2 * r2
    low = (1.0 + r) + r2 * (0.5 + r * (1.0 / 6))
    mid = (1.0 / 24 + r * (1.0 / 120)) + r2 * (1.0 / 720 + r * (1.0 / 5040))
    high = (1.0 / 40320 + r * (1.0 / 362880)) + r2 * (1.0 / 3628800 + r * (1.0 / 39916800))
    power = np.int64((np.float64(shifted).view(np.int64) + 1023) << 52).view(np.float64)
    return ((low + r4 * mid) + (r4 * r4) * high) * power


@inlined
def stiffening(b: float, strain: float) -> float:
    """exp(b |strain|), the factor of the exponential spring."""
    return vector_exp(min(b * abs(strain), LARGEST_EXPONENT))


@row_loop
def constant_force(x: Matrix, p: int, q: int, n: int, k: float, length: float, t: Matrix) -> None:
    """Pull of springs from row p to row q: k (r - L) d / r, in N."""
    xp, yp, zp = x[0][p : p + n], x[1][p : p + n], x[2][p : p + n]
    xq, yq, zq = x[0][q : q + n], x[1][q : q + n], x[2][q : q + n]
    tx, ty, tz = t[0][PAD : PAD + n], t[1][PAD : PAD + n], t[2][PAD : PAD + n]
    for c in range(n):
        dx, dy, dz = xq[c] - xp[c], yq[c] - yp[c], zq[c] - zp[c]
        s = k - (k * length) / np.sqrt(dx * dx + dy * dy + dz * dz + TINY)
        tx[c], ty[c], tz[c] = s * dx, s * dy, s * dz


@row_loop
def exponential_force(x: Matrix, p: int, q: int, n: int, k: float, length: float, b: float, t: Matrix) -> None:
    """Pull of springs whose stiffness is k exp(b |r/L - 1|), in N."""
    xp, yp, zp = x[0][p : p + n], x[1][p : p + n], x[2][p : p + n]
    xq, yq, zq = x[0][q : q + n], x[1][q : q + n], x[2][q : q + n]
    tx, ty, tz = t[0][PAD : PAD + n], t[1][PAD : PAD + n], t[2][PAD : PAD + n]
    inverse = 1.0 / length
    for c in range(n):
        dx, dy, dz = xq[c] - xp[c], yq[c] - yp[c], zq[c] - zp[c]
        r = np.sqrt(dx * dx + dy * dy + dz * dz + TINY)
        s = (k - k * length / r) * stiffening(b, r * inverse - 1.0)
        tx[c], ty[c], tz[c] = s * dx, s * dy, s * dz


@row_loop
def spring_product(x: Matrix, u: Matrix, p: int, q: int, n: int, k: float, length: float, b: float, t: Matrix) -> None:
    """Change of the pull for a small displacement u: [(T' - T/r) n (n.du) + (T/r) du]; b = 0 is the constant spring."""
    xp, yp, zp = x[0][p : p + n], x[1][p : p + n], x[2][p : p + n]
    xq, yq, zq = x[0][q : q + n], x[1][q : q + n], x[2][q : q + n]
    up, vp, wp = u[0][p : p + n], u[1][p : p + n], u[2][p : p + n]
    uq, vq, wq = u[0][q : q + n], u[1][q : q + n], u[2][q : q + n]
    tx, ty, tz = t[0][PAD : PAD + n], t[1][PAD : PAD + n], t[2][PAD : PAD + n]
    for c in range(n):
        dx, dy, dz = xq[c] - xp[c], yq[c] - yp[c], zq[c] - zp[c]
        du, dv, dw = uq[c] - up[c], vq[c] - vp[c], wq[c] - wp[c]
        r2 = dx * dx + dy * dy + dz * dz + TINY
        r = np.sqrt(r2)
        strain = r / length - 1.0
        grown = k * stiffening(b, strain)
        s = grown * (1.0 - length / r)
        along = (grown * (1.0 + b * abs(strain)) - s) * (dx * du + dy * dv + dz * dw) / r2
        tx[c], ty[c], tz[c] = along * dx + s * du, along * dy + s * dv, along * dz + s * dw


@row_loop
def spring_diagonal(x: Matrix, p: int, q: int, n: int, k: float, length: float, b: float, t: Matrix) -> None:
    """Bound of the diagonal of a spring's Hessian, one positive value per direction, in N/mm."""
    xp, yp, zp = x[0][p : p + n], x[1][p : p + n], x[2][p : p + n]
    xq, yq, zq = x[0][q : q + n], x[1][q : q + n], x[2][q : q + n]
    tx, ty, tz = t[0][PAD : PAD + n], t[1][PAD : PAD + n], t[2][PAD : PAD + n]
    for c in range(n):
        dx, dy, dz = xq[c] - xp[c], yq[c] - yp[c], zq[c] - zp[c]
        r2 = dx * dx + dy * dy + dz * dz + TINY
        r = np.sqrt(r2)
        strain = r / length - 1.0
        grown = k * stiffening(b, strain)
        across = min(abs(grown * (1.0 - length / r)), grown)
        along = grown * (1.0 + b * abs(strain)) / r2
        tx[c], ty[c], tz[c] = along * dx * dx + across, along * dy * dy + across, along * dz * dz + across


@row_loop
def spring_energy(x: Matrix, p: int, q: int, n: int, k: float, length: float, b: float, t: Matrix) -> None:
    """Energy of each spring in N mm: k (r-L)^2 / 2, or k L^2 [(b e - 1) exp(b e) + 1] / b^2 with e = |r/L - 1|."""
    xp, yp, zp = x[0][p : p + n], x[1][p : p + n], x[2][p : p + n]
    xq, yq, zq = x[0][q : q + n], x[1][q : q + n], x[2][q : q + n]
    out = t[0][PAD : PAD + n]
    for c in range(n):
        dx, dy, dz = xq[c] - xp[c], yq[c] - yp[c], zq[c] - zp[c]
        e = abs(np.sqrt(dx * dx + dy * dy + dz * dz + TINY) / length - 1.0)
        be = min(b * e, LARGEST_EXPONENT)
        if be < 0.05:  # the closed form loses digits here; next term of the series is be^4/144 relative
            shape = e * e * (0.5 + be * (1.0 / 3.0 + be * (0.125 + be * (1.0 / 30.0 + be / 144.0))))
        else:
            shape = ((be - 1.0) * vector_exp(be) + 1.0) / (b * b)
        out[c] = k * length * length * shape


@row_loop
def add_own(f: Floats, p: int, n: int, t: Floats, back: float, low: Floats) -> None:
    """f[p] += t, and ``back`` times the spring that arrives from one node below."""
    out, near, below = f[p : p + n], t[PAD : PAD + n], low[PAD - 1 : PAD - 1 + n]
    for c in range(n):
        out[c] += near[c] + back * below[c]


@row_loop
def add_sum(f: Floats, p: int, n: int, a: Floats, b: Floats, c: Floats, d: Floats) -> None:
    """f[p] += a + b + c + d, the near ends of four directions in one pass."""
    out, ra, rb, rc, rd = f[p : p + n], a[PAD : PAD + n], b[PAD : PAD + n], c[PAD : PAD + n], d[PAD : PAD + n]
    for i in range(n):
        out[i] += ra[i] + rb[i] + rc[i] + rd[i]


@row_loop
def add_far(f: Floats, q: int, n: int, level: Floats, up: Floats, down: Floats, sign: float) -> None:
    """Far ends in a neighbouring row: springs at the same level, from one below (``up``), from one above (``down``)."""
    out = f[q : q + n]
    flat, below, above = level[PAD : PAD + n], up[PAD - 1 : PAD - 1 + n], down[PAD + 1 : PAD + 1 + n]
    for c in range(n):
        out[c] += sign * (flat[c] + below[c] + above[c])


@row_loop
def add_level(f: Floats, q: int, n: int, t: Floats, sign: float) -> None:
    """Far ends at the same level."""
    out, flat = f[q : q + n], t[PAD : PAD + n]
    for c in range(n):
        out[c] += sign * flat[c]
