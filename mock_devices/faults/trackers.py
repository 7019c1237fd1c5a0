"""Faults that devices of several makers have alike: each sets one attribute of the mock."""

from collections.abc import Callable

from mock_devices.faults.wires import Value, as_number

MOST_TOOLS = 24
RAREST = 1_000_000


def hiding(attribute: str) -> Callable[[object, Value], None]:
    """What hides the tool of that index, or none for false."""

    def apply(target: object, value: Value) -> None:
        setattr(target, attribute, set() if value is False else {round(as_number(value, 0, MOST_TOOLS - 1))})

    return apply


def spoiling(attribute: str) -> Callable[[object, Value], None]:
    """What spoils every n-th message."""
    return lambda target, value: setattr(target, attribute, round(as_number(value, 0, RAREST)))
