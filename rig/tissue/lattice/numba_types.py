"""Array types as the kernels see them, and the decorators that compile them.

A row kernel is compiled on its own, the first time it is asked for, and its drivers call it through a pointer. Linked
into its callers it would be optimised again in each of them; that, and kernels nobody asked for, once took most of the
time of a first call.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numba import cfunc, njit, types
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
"""Flat rows, float64, C order."""
Matrix: TypeAlias = NDArray[np.float64]
"""Stacks of rows, float64, C order."""
RowKernel: TypeAlias = Any
"""A compiled row kernel, as drivers take it."""

_MATRIX, _FLAT = types.float64[:, ::1], types.float64[::1]
_INDEX, _REAL = types.int64, types.float64
SPRING = types.void(
    _MATRIX, _MATRIX, _INDEX, _INDEX, _INDEX, _REAL, _REAL, _REAL, _FLAT, _INDEX, _FLAT, _INDEX
)  # x, u, p, q, n, k, length, b, t, out, masks, m
CELL = types.void(
    _MATRIX, _MATRIX, _INDEX, _INDEX, _INDEX, _INDEX, _INDEX, _REAL, _REAL, _REAL, _FLAT, _FLAT, _INDEX
)  # x, u, p, low, high, stride, n, kv_low, kv_high, volume, t, masks, m
SUM = types.void(_MATRIX, _INDEX, _INDEX, _INDEX, _FLAT, _INDEX, _INDEX, _INDEX, _REAL)  # f, w, p, n, t, a, b, c, sign

Function = TypeVar("Function", bound=Callable[..., object])
_ROWS = {
    "contract",
    "nsz",
    "arcp",
    "nnan",
    "ninf",
}  # loops over rows: no infinities or NaN can arise in them, see rows.TINY
_SUMS = {"contract", "nsz", "reassoc"}  # loops that add up and must notice a NaN
_PLAIN: set[str] = set()
_Options = dict[str, Any]
_BARE: _Options = {"_nrt": False, "no_cfunc_wrapper": True}  # no arrays are created: no reference counts
_INNER: _Options = {**_BARE, "no_cpython_wrapper": True}
_KEPT: _Options = {**_BARE, "cache": True, "nogil": True}


def _compiled(function: Function, fastmath: set[str], options: _Options) -> Function:
    return cast(Function, njit(fastmath=fastmath, error_model="numpy", **options)(function))


def row_kernel(signature: object) -> Callable[[Callable[..., None]], Callable[[], RowKernel]]:
    """Compile an inner loop when it is first asked for; kept on disk."""
    options: _Options = {"cache": True, "_nrt": False}

    def lazy(function: Callable[..., None]) -> Callable[[], RowKernel]:
        @cache
        def compiled() -> RowKernel:
            return cfunc(signature, fastmath=_ROWS, error_model="numpy", **options)(function)

        return compiled

    return lazy


def part(function: Function) -> Function:
    """Compile a piece of a row kernel's body."""
    return _compiled(function, _ROWS, _INNER)


def piece(function: Function) -> Function:
    """Compile a piece of a driver."""
    return _compiled(function, _PLAIN, _INNER)


def driver(function: Function) -> Function:
    """Compile a function that orders row kernels; kept on disk."""
    return _compiled(function, _PLAIN, _KEPT)


def sum_loop(function: Function) -> Function:
    """Compile a loop with sums in any order; kept on disk."""
    return _compiled(function, _SUMS, _KEPT)
