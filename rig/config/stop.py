"""`[stop]` of `rig.toml`: the stop process' port, and the foot switch or keypad that it listens to."""

from typing import Literal

from pydantic import Field, field_validator

from rig.config.table import Table

StopKind = Literal["stop", "pain", "emergency"]
# linux/input-event-codes.h; a foot switch sends one of these as it comes from the shop, mostly b.
KEY_CODES = {
    "esc": 1,
    "backspace": 14,
    "q": 16,
    "p": 25,
    "enter": 28,
    "a": 30,
    "s": 31,
    "b": 48,
    "space": 57,
    "f1": 59,
    "keypad_0": 82,
    "keypad_enter": 96,
    "page_up": 104,
    "page_down": 109,
    "mouse_left": 0x110,
    "mouse_right": 0x111,
}
KEY_CODE_MAX = 0x2FF  # KEY_MAX of Linux' input-event-codes.h


def key_number(name: str) -> int:
    """The code of a key by its name or number; raises ValueError where there is no such key."""
    if name not in KEY_CODES and not (name.isdecimal() and 0 < int(name) <= KEY_CODE_MAX):
        raise ValueError(f"no key {name!r}: write a number from 1 to {KEY_CODE_MAX}, or {', '.join(KEY_CODES)}")
    return KEY_CODES.get(name) or int(name)


class Stop(Table):
    """How a person stops the bench beside the program that runs it."""

    port: int = Field(
        default=8001, ge=0, le=65535, description="on 127.0.0.1; any free one where it is taken, or where it is 0"
    )
    keypad: str = Field(default="", description="input device, for example /dev/input/by-id/...-event-kbd; empty: none")
    keypad_required: bool = Field(default=False, description="without it nothing moves")
    keys: dict[str, StopKind] = Field(
        default_factory=lambda: dict[str, StopKind](p="pain", b="pain", s="stop", space="emergency"),
        description="name of a key, or its number in linux/input-event-codes.h",
    )
    other_keys: StopKind = Field(default="emergency", description="what every other key of that device does")

    @field_validator("keys")
    @classmethod
    def _known(cls, keys: dict[str, StopKind]) -> dict[str, StopKind]:
        for name in keys:
            key_number(name)
        return keys

    @property
    def key_codes(self) -> dict[int, StopKind]:
        """What each key does, by its number."""
        return {key_number(name): kind for name, kind in self.keys.items()}
