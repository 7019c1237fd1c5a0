"""Array types as the kernels see them, and the decorators that compile them."""

from collections.abc import Callable
from typing import TypeAlias, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
"""Flat rows, float64, C order."""
Matrix: TypeAlias = NDArray[np.float64]
"""Stacks of rows, float64, C order."""

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


def row_loop(function: Function) -> Function:
    """Compile an inner loop; kept on disk."""
    return cast(Function, njit(fastmath=_ROWS, error_model="numpy", cache=True, nogil=True)(function))


def inlined(function: Function) -> Function:
    """Compile a few operations into the loop that calls them."""
    return cast(Function, njit(inline="always", fastmath=_ROWS, error_model="numpy")(function))


def part(function: Function) -> Function:
    """Compile a piece of a loop's body."""
    return cast(Function, njit(fastmath=_ROWS, error_model="numpy")(function))


def driver(function: Function) -> Function:
    """Compile a function that orders loops; kept on disk."""
    return cast(Function, njit(fastmath=_PLAIN, error_model="numpy", cache=True, nogil=True)(function))


def sum_loop(function: Function) -> Function:
    """Compile a loop with sums in any order; kept on disk."""
    return cast(Function, njit(fastmath=_SUMS, error_model="numpy", cache=True, nogil=True)(function))
