"""How long computations say how far they are."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called with what comes now and the share of the whole that is done; what it raises ends the computation."""


def silent(_message: str, _share: float) -> None:
    """Progress nobody watches."""


def portion(tell: Progress, first: float, last: float) -> Progress:
    """Progress of a step that takes a computation from the share ``first`` of it to the share ``last``."""
    return lambda message, share: tell(message, first + share * (last - first))
