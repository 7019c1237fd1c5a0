"""The role of input: several on a bench, each with channels of its own; `drivers.roles` says what every driver does."""

from collections.abc import Sequence
from typing import Protocol

from drivers.roles import Device
from rig.input_streams import InputSample


class Input(Device, Protocol):
    """A switch, a glove, a stream of another program. ``period_ns`` is 0 where samples come when they come."""

    def poll(self, now_ns: int) -> Sequence[InputSample]:
        """Samples since the last call."""

    def concern(self) -> str:
        """What is not as it should be while samples come, in words; empty if nothing."""
