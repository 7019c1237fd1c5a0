"""A foot switch or push button that shows itself to Linux as a keyboard or mouse."""

from typing import ClassVar, Literal

from pydantic import Field, field_validator

from rig.config.products.input_role import InputProduct
from rig.config.products.roles import MockPort
from rig.config.stop import StopKind, key_number
from rig.input_streams import InputChannel


class EvdevSwitch(InputProduct):
    """A foot switch by Linux' input events; its port is a path, or `name:` and the name that the device has."""

    driver: ClassVar[str] = "drivers.evdev.device:open_switch"
    mock: ClassVar[MockPort | None] = MockPort("mock_devices.inputs:switch", "switch", "events")
    advice: ClassVar[str] = "its cable, its port, and whether you are in the group input"
    switch: ClassVar[str] = "pressed"
    at_line: ClassVar[bool] = False

    product: Literal["evdev-switch"] = Field(default="evdev-switch", description="what it is")
    key: str = Field(default="", description="name or number of the one key that counts; empty: any of them")
    stops: Literal["", "stop", "pain", "emergency"] = Field(
        default="", description="what pressing it asks for; such a switch is needed. Empty: it is a marker alone"
    )

    @property
    def channels(self) -> tuple[InputChannel, ...]:
        """The key and what it did."""
        return (
            InputChannel("pressed", "1", "1: a key went down, 0: it came up"),
            InputChannel("key", "1", "its code, of linux/input-event-codes.h"),
        )

    @property
    def nominal_Hz(self) -> float:
        """A person presses it now and then."""
        return 0.0

    @property
    def asks_for(self) -> StopKind | None:
        """The stop that pressing it asks for."""
        return self.stops or None

    @field_validator("key")
    @classmethod
    def _known(cls, key: str) -> str:
        if key:
            key_number(key)
        return key

    @property
    def key_code(self) -> int | None:
        """Of the one key that counts."""
        return key_number(self.key) if self.key else None
