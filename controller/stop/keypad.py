"""Keys of a foot switch or keypad from Linux' input events: 24 bytes each, decoded here (linux/input.h)."""

import contextlib
import fcntl
import os
import stat
import struct
from collections.abc import Mapping
from dataclasses import dataclass

from controller.stop.word import StopReason
from rig.errors import DeviceError

# Seconds and microseconds of a 64-bit computer, type, code, value.
EVENT = struct.Struct("<qqHHi")
EV_KEY = 1
DOWN = 1
# Takes the device for this program alone: what is pressed there is not typed into a terminal as well.
EVIOCGRAB = 0x40044590
READ_EVENTS = 64


class EventParser:
    """Bytes to the codes of keys that went down; repeats of a held key, releases and other events are passed over."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[int]:
        """Codes of keys pressed in ``data``, in order."""
        whole = self._rest + data
        end = len(whole) - len(whole) % EVENT.size
        self._rest = whole[end:]
        return [code for _, _, kind, code, value in EVENT.iter_unpack(whole[:end]) if kind == EV_KEY and value == DOWN]


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
        self._parser = EventParser()
        with contextlib.suppress(OSError):
            fcntl.ioctl(fd, EVIOCGRAB, 1)

    def read(self) -> list[int]:
        """Codes of keys pressed since the last call."""
        try:
            data = os.read(self.fd, READ_EVENTS * EVENT.size)
        except BlockingIOError:
            return []
        except OSError as error:
            raise DeviceError(f"{self.path}: the keypad is gone: {error.strerror}; plug it in again") from error
        if not data:
            raise DeviceError(f"{self.path}: the keypad is gone; plug it in again")
        return self._parser.feed(data)

    def close(self) -> None:
        """Gives the device back."""
        os.close(self.fd)


def open_device(path: str) -> int:
    """Descriptor of the input device at ``path``; raises DeviceError where it is none, or may not be read."""
    try:
        fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise DeviceError(
            f"stop.keypad {path}: {error.strerror}; ls -l /dev/input/by-id shows the devices there are, "
            "and whoever reads one must be in group input"
        ) from error
    mode = os.fstat(fd).st_mode
    if not (stat.S_ISCHR(mode) or stat.S_ISFIFO(mode)):
        os.close(fd)
        raise DeviceError(f"stop.keypad {path}: is no input device; give one of /dev/input/by-id")
    return fd
