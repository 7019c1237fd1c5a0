"""The stop process' foot switch or keypad: what each of its keys asks for."""

from collections.abc import Mapping
from dataclasses import dataclass

from controller.stop.word import StopReason
from drivers.evdev import port
from drivers.evdev.codec import EventParser


@dataclass(frozen=True)
class Keys:
    """What each key asks for."""

    by_code: Mapping[int, StopReason]
    other: StopReason

    def kind(self, code: int) -> StopReason:
        """What key ``code`` asks for."""
        return self.by_code.get(code, self.other)


class Pad:
    """One device, open; ``read`` raises DeviceError once it is gone."""

    def __init__(self, path: str, fd: int) -> None:
        self.path, self.fd = path, fd
        self._port, self._parser = port.EventPort(path, fd, "the keypad"), EventParser()

    def read(self) -> list[int]:
        """Codes of keys pressed since the last call."""
        return self._parser.feed(self._port.read())

    def close(self) -> None:
        """Gives the device back."""
        self._port.close()


def open_device(path: str) -> int:
    """Descriptor of the input device at ``path``; raises DeviceError where it is none, or may not be read."""
    return port.open_device(path, "stop.keypad")
