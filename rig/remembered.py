"""Last results kept: a slope over one parameter asks again for most of what the point itself has worked out."""

from collections.abc import Callable
from functools import partial, wraps
from typing import TypeVar

import numpy as np

KEPT = 8  # of a point, and of it with a parameter moved that changes one step of a simulation
R = TypeVar("R")


def remembered(work: Callable[..., R]) -> Callable[..., R]:
    """A pure function with its last results given again for the same arguments; they cannot be written into.

    Arrays are the same number by number, tuples item by item, all else but numbers by being one object.
    """
    kept: tuple[tuple[tuple[object, ...], R], ...] = ()

    @wraps(work)
    def asked(*given: object) -> R:
        nonlocal kept
        one = next((one for one in kept if _is_same(given, one[0])), None)
        if one is None:
            one = tuple(a.copy() if isinstance(a, np.ndarray) else a for a in given), work(*given)
            for array in one[1] if isinstance(one[1], tuple) else (one[1],):
                np.asarray(array).flags.writeable = False
        kept = (one, *(other for other in kept if other is not one))[:KEPT]
        return one[1]

    return asked


def known_of(work: Callable[..., R]) -> Callable[..., R]:
    """The same, kept with its first argument, an object that never changes, for as long as that is there."""

    @wraps(work)
    def asked(model: object, *given: object) -> R:
        kept: Callable[..., R] = vars(model).setdefault(work.__qualname__, remembered(partial(work, model)))
        return kept(*given)

    return asked


def _is_same(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        middle = one.size // 2  # where nearly all that differ do so: the tip is in the tissue
        return one.shape == other.shape and bool(one.flat[middle] == other.flat[middle]) and np.array_equal(one, other)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return one is other or (len(one) == len(other) and all(map(_is_same, one, other)))
    return one is other or (isinstance(one, float) and isinstance(other, float) and one == other)


exp, sin, cos = (remembered(function) for function in (np.exp, np.sin, np.cos))
