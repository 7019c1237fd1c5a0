"""How long computations say how far they are."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called with what comes now and the share of the whole that is done; what it raises ends the computation."""


def silent(_message: str, _share: float) -> None:
    """Progress nobody watches."""
