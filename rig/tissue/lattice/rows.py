"""Inner loops over rows of springs; everything here is vectorised by the compiler.

A row is ``n`` consecutive nodes of the flat arrays. Results go to rows of one flat buffer at the constant distance
``WIDTH``, with ``PAD`` zeros on both sides, so that the sums can read their neighbours in z without a branch and the
compiler can see that rows do not overlap. Masks are rows of a second buffer: row 3 (dj + 1) + dk + 1 of a set weighs
what goes from a node to its neighbour at (dj, dk) in y and z, 0 where there is none.
"""

import numpy as np

from rig.tissue.lattice.numba_types import SPRING, SUM, Floats, Matrix, part, row_kernel

PAD = 8
WIDTH = 352  # one buffer row: nodes of a few rows and padding on both sides
LONGEST_ROW = WIDTH - 2 * PAD
ZEROS = 27  # a row nobody writes, after three rows for each of nine directions
MASKS = 9  # rows of one set
FRONT = WIDTH  # room before the first node of the flat arrays: kernels read one row below it
TINY = 1e-24  # mm^2; two nodes that meet exactly then pull with no force instead of with one that is not a number
LARGEST_EXPONENT = 300.0  # exp(300) is a failed step, not a spring; keeps infinities out of the sums

Vector = tuple[float, float, float]


@part
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


@part
def stiffening(b: float, strain: float) -> float:
    """exp(b |strain|), the factor of the exponential spring."""
    return vector_exp(min(b * abs(strain), LARGEST_EXPONENT))


@part
def at(index: int) -> int:
    """An index as numba wants it: unsigned, so that it needs no test for one counted from the end, and no gather."""
    return np.uint64(index)  # type: ignore[return-value]


@part
def between(x: Matrix, p: int, q: int) -> Vector:
    """From node p to node q."""
    return x[0, at(q)] - x[0, at(p)], x[1, at(q)] - x[1, at(p)], x[2, at(q)] - x[2, at(p)]


@part
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def store(t: Floats, row: int, s: float, a: Vector) -> None:
    """Put s a into three buffer rows."""
    t[at(row)] = s * a[0]
    t[at(row + WIDTH)] = s * a[1]
    t[at(row + 2 * WIDTH)] = s * a[2]


@row_kernel(SPRING)
def constant_force(
    x: Matrix, _u: Matrix, p: int, q: int, n: int, k: float, length: float, _b: float,
    t: Floats, out: int, masks: Floats, m: int,
) -> None:  # fmt: skip
    """Pull of springs from row p to row q: k (r - L) d / r, in N."""
    for c in range(n):
        d = between(x, p + c, q + c)
        store(t, out + c, masks[at(m + c)] * (k - (k * length) / np.sqrt(dot(d, d) + TINY)), d)


@row_kernel(SPRING)
def exponential_force(
    x: Matrix, _u: Matrix, p: int, q: int, n: int, k: float, length: float, b: float,
    t: Floats, out: int, masks: Floats, m: int,
) -> None:  # fmt: skip
    """Pull of springs whose stiffness is k exp(b |r/L - 1|), in N."""
    inverse = 1.0 / length
    for c in range(n):
        d = between(x, p + c, q + c)
        r = np.sqrt(dot(d, d) + TINY)
        store(t, out + c, masks[at(m + c)] * (k - k * length / r) * stiffening(b, r * inverse - 1.0), d)


@row_kernel(SPRING)
def spring_product(
    x: Matrix, u: Matrix, p: int, q: int, n: int, k: float, length: float, b: float,
    t: Floats, out: int, masks: Floats, m: int,
) -> None:  # fmt: skip
    """Change of the pull for a small displacement u: [(T' - T/r) n (n.du) + (T/r) du]; b = 0 is the constant spring."""
    for c in range(n):
        d, du = between(x, p + c, q + c), between(u, p + c, q + c)
        r2 = dot(d, d) + TINY
        r = np.sqrt(r2)
        strain = r / length - 1.0
        grown = k * stiffening(b, strain)
        s = grown * (1.0 - length / r)
        along = (grown * (1.0 + b * abs(strain)) - s) * dot(d, du) / r2
        store(
            t, out + c, masks[at(m + c)], (along * d[0] + s * du[0], along * d[1] + s * du[1], along * d[2] + s * du[2])
        )


@row_kernel(SPRING)
def spring_diagonal(
    x: Matrix, _u: Matrix, p: int, q: int, n: int, k: float, length: float, b: float,
    t: Floats, out: int, masks: Floats, m: int,
) -> None:  # fmt: skip
    """Bound of the diagonal of a spring's Hessian, one positive value per direction, in N/mm."""
    for c in range(n):
        d = between(x, p + c, q + c)
        r2 = dot(d, d) + TINY
        r = np.sqrt(r2)
        strain = r / length - 1.0
        grown = k * stiffening(b, strain)
        across = min(abs(grown * (1.0 - length / r)), grown)
        along = grown * (1.0 + b * abs(strain)) / r2
        store(
            t,
            out + c,
            masks[at(m + c)],
            (along * d[0] ** 2 + across, along * d[1] ** 2 + across, along * d[2] ** 2 + across),
        )


@row_kernel(SUM)
def add_three(f: Matrix, w: int, p: int, n: int, t: Floats, a: int, b: int, c: int, sign: float) -> None:
    """f[w, p:] += sign (three stretches of the buffer)."""
    for i in range(n):
        f[at(w), at(p + i)] += sign * (t[at(a + i)] + t[at(b + i)] + t[at(c + i)])
