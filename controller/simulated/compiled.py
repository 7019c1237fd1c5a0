"""Machine code of the loop's own functions, for simulation: the same source, so that what is simulated is what runs."""

from collections.abc import Callable, Mapping
from types import FunctionType
from typing import TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function, parts: Mapping[str, object] | None = None) -> Function:
    """``function`` compiled, its calls to module-level functions named in ``parts`` going to those given."""
    assert isinstance(function, FunctionType)
    bound = FunctionType(
        function.__code__, {**function.__globals__, **(parts or {})}, function.__name__, function.__defaults__
    )
    return cast(Function, njit(bound))
