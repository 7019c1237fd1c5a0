"""An input device of Linux, opened for this program alone, and found by its name."""

import contextlib
import fcntl
import os
import stat
import struct
import time
from pathlib import Path

from drivers.evdev.codec import EVENT
from rig.errors import DeviceError

# Takes the device for this program alone: what is pressed there is not typed into a terminal as well.
EVIOCGRAB = 0x40044590
# Times of events by CLOCK_MONOTONIC; without it by the time of day.
EVIOCSCLOCKID = 0x400445A0
READ_EVENTS = 64
NAMES = Path("/sys/class/input")


class EventPort:
    """One device by its descriptor, called ``what`` in messages."""

    def __init__(self, path: str, fd: int, what: str) -> None:
        self.path, self.fd, self._what = path, fd, what
        with contextlib.suppress(OSError):
            fcntl.ioctl(self.fd, EVIOCGRAB, 1)

    def use_host_clock(self) -> bool:
        """Whether times of its events are the host's monotonic ones from now on; else they are a time of day."""
        try:
            fcntl.ioctl(self.fd, EVIOCSCLOCKID, struct.pack("i", time.CLOCK_MONOTONIC))
        except OSError:
            return False
        return True

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self.fd

    def read(self) -> bytes:
        """What has come since the last call; raises DeviceError once the device is gone."""
        try:
            data = os.read(self.fd, READ_EVENTS * EVENT.size)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise DeviceError(f"{self.path}: {self._what} is gone: {error.strerror}; plug it in again") from error
        if not data:
            raise DeviceError(f"{self.path}: {self._what} is gone; plug it in again")
        return data

    def close(self) -> None:
        """Gives the device back; may be called twice."""
        if self.fd >= 0:
            os.close(self.fd)
        self.fd = -1


def open_device(path: str, what: str) -> int:
    """Descriptor of the input device at ``path``; raises DeviceError where it is none, or may not be read."""
    try:
        fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise DeviceError(
            f"{what} {path}: {error.strerror}; ls -l /dev/input/by-id shows the devices there are, "
            "and whoever reads one must be in group input"
        ) from error
    mode = os.fstat(fd).st_mode
    if not (stat.S_ISCHR(mode) or stat.S_ISFIFO(mode)):
        os.close(fd)
        raise DeviceError(f"{what} {path}: is no input device; give one of /dev/input/by-id")
    return fd


def path_of(name: str, names: Path = NAMES) -> str:
    """The device that calls itself ``name``; raises DeviceError where there is none of it, or more than one."""
    known = _by_node(names)
    paths = [f"/dev/input/{node}" for node, its_name in known.items() if its_name == name]
    if len(paths) == 1:
        return paths[0]
    if paths:
        raise DeviceError(f"{len(paths)} input devices are called {name!r}: {', '.join(paths)}; give one by its port")
    there = ", ".join(repr(its_name) for its_name in known.values()) or "none at all"
    raise DeviceError(f"no input device is called {name!r}; there are: {there}; plug it in, or correct the name")


def key_devices(names: Path = NAMES) -> list[str]:
    """Names of the input devices that have keys or buttons, each once; nothing is opened."""
    with_keys = (node for node in names.glob("event*") if _has_keys(node / "device/capabilities/key"))
    known = _by_node(names)
    return list(dict.fromkeys(known[node.name] for node in sorted(with_keys) if node.name in known))


def _by_node(names: Path) -> dict[str, str]:
    return {found.parents[1].name: found.read_text().strip() for found in sorted(names.glob("event*/device/name"))}


def _has_keys(capabilities: Path) -> bool:
    return capabilities.is_file() and capabilities.read_text().strip(" 0\n") != ""
