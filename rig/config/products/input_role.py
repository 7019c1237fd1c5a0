"""The role of input: what a bench records beside its own streams, and what of it may stop motion.

There may be several, each a table `[input.NAME]` of `rig.toml`; the name is that of its stream in recordings.
"""

from collections.abc import Mapping, Sequence
from typing import ClassVar

from pydantic import Field

from rig.config.products.roles import MOCK_PORT, Product
from rig.config.stop import StopKind
from rig.input_streams import (
    CHANNEL_NAME,
    LONGEST_NAME,
    MOST_CHANNELS,
    MOST_INPUTS,
    NAME,
    InputChannel,
    taken_fields,
    taken_names,
)


class InputProduct(Product):
    """An input. ``channels`` is what each of its samples holds, ``nominal_Hz`` 0 where samples come when they come.

    ``switch`` is the channel that is 1 while a switch is pressed, where the product is one.
    """

    switch: ClassVar[str] = ""
    # Whether it stands at a serial line, where `rig find` may look for it.
    at_line: ClassVar[bool] = True

    needed: bool = Field(default=False, description="without it nothing moves, and losing it retracts the tip")

    @property
    def channels(self) -> tuple[InputChannel, ...]:
        """Quantities of each sample."""
        raise NotImplementedError

    @property
    def nominal_Hz(self) -> float:
        """Samples a second; 0: irregular."""
        raise NotImplementedError

    @property
    def promised_Hz(self) -> float | None:
        """As nominal."""
        return self.nominal_Hz or None

    @property
    def asks_for(self) -> StopKind | None:
        """The stop that pressing it asks for."""
        return None

    @property
    def is_needed(self) -> bool:
        """Whether motion depends on it; a stop that may be lost unnoticed would be none."""
        return self.needed or self.asks_for is not None

    @property
    def place(self) -> str:
        """Where it is plugged in, for messages and to tell two of them apart."""
        return self.port


def channel_trouble(channels: Sequence[InputChannel]) -> str:
    """What is wrong with the channels that a table names; empty where nothing is."""
    names = [channel.name for channel in channels]
    wrong = [name for name in names if not CHANNEL_NAME.fullmatch(name) or name in taken_fields()]
    if wrong:
        return f"{wrong[0]!r} is no name of a channel: letters, digits and _, a small letter first, and none of " + (
            ", ".join(sorted(taken_fields()))
        )
    if not 1 <= len(names) <= MOST_CHANNELS:
        return f"{len(names)} channels; a sample takes 1 to {MOST_CHANNELS}"
    return ""


def brought_by(inputs: Mapping[str, InputProduct]) -> dict[str, tuple[InputChannel, ...]]:
    """What each input brings, by its name."""
    return {name: product.channels for name, product in inputs.items()}


def input_troubles(inputs: Mapping[str, InputProduct], keypad: str) -> list[str]:
    """What is wrong with ``inputs`` as a whole, ``keypad`` being that of the stop process: a sentence, or none."""
    return [trouble for trouble in [_input_trouble(inputs, keypad)] if trouble]


def _input_trouble(inputs: Mapping[str, InputProduct], keypad: str) -> str:
    if len(inputs) > MOST_INPUTS:
        return f"{len(inputs)} inputs; a recording takes {MOST_INPUTS}"
    places: dict[str, str] = {keypad: "stop.keypad"} if keypad else {}
    for name, product in inputs.items():
        if not NAME.fullmatch(name) or len(name) > LONGEST_NAME or name in taken_names():
            return (
                f"input.{name}: is no name of an input: at most {LONGEST_NAME} small letters, digits and _, a letter"
                f" first, and none of {', '.join(sorted(taken_names()))}"
            )
        place = f"{product.product} {product.place}" if product.port == MOCK_PORT else product.place
        if place in places:
            return (
                f"input.{name}: {place} is {places[place]} already; each device is one input and is opened once:"
                " give this one the port of its own"
            )
        places[place] = f"input.{name}"
    return ""
