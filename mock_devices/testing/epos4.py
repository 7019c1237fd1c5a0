"""The drive mock for tests: in this process on an injected clock, or in another one in real time.

The other process is ``python -m mock_devices.testing.epos4``. It prints its endpoint as one line of JSON; each line it
reads sets or asks something: ``{"set": "silent", "value": true}``, ``{"fault": 9040}``, ``{"cut": true}``,
``{"ask": true}``, and is answered by one line with the plant's state.
"""

import contextlib
import json
import math
import select
import sys
import time
from typing import Any

import can

from drivers.can.health import BusHealth
from drivers.can.slcan import CanFrame, SlcanDecoder, encode_frame
from drivers.canopen.nmt import NmtState
from drivers.ports import PortClosed
from mock_devices.can.bus_adapter import BusNode
from mock_devices.epos4.mock import Epos4Mock
from mock_devices.interfaces import NEVER_NS
from mock_devices.testing.remote import RemoteMock, say
from mock_devices.testing.wire import MemoryWire
from mock_devices.wire import PtyWire

MS = 1_000_000
ACCELERATION_PER_CURRENT = 100.0  # mm/s2 for each ampere
TIME_CONSTANT_S = 1 / (2 * math.pi * 25)


class LaggingPlant:
    """A carriage that follows its target with one time constant; the reference switch is at and below 0 mm."""

    def __init__(self, position_mm: float = 8.0) -> None:
        self.position_mm = position_mm
        self.velocity_mm_s = 0.0
        self.current_A = 0.0
        self.current_limit_A = 5.0
        self.has_switch = True
        self.powered = False
        self.target_mm = position_mm
        self.pushed_A: float | None = None
        self.stop_mm = -1e9
        self.at_reference = position_mm <= 0

    def power(self, on: bool) -> None:
        self.powered = on
        self.target_mm, self.pushed_A = self.position_mm, None

    def target(self, position_mm: float) -> None:
        self.target_mm = position_mm
        self.pushed_A = None

    def push(self, current_A: float) -> None:
        self.pushed_A = current_A

    def advance(self, dt_s: float) -> None:
        """Moves on; where the carriage meets ``stop_mm`` the current grows with the lag."""
        before = self.position_mm
        if self.powered and self.pushed_A is not None:
            self.velocity_mm_s += self.pushed_A * ACCELERATION_PER_CURRENT * dt_s
            self.position_mm = self.target_mm = before + self.velocity_mm_s * dt_s
        elif self.powered:
            self.position_mm += (self.target_mm - before) * (1 - math.exp(-dt_s / TIME_CONSTANT_S))
            self.position_mm = max(self.position_mm, self.stop_mm)
        self.velocity_mm_s = (self.position_mm - before) / dt_s
        pulled_A = 2 * (self.target_mm - self.position_mm) if self.pushed_A is None else self.pushed_A
        self.current_A = pulled_A if self.powered else 0.0
        self.at_reference = self.has_switch and self.position_mm <= 0


class HostDied(Exception):
    """The client's process is no more."""


class DriveBench:
    """A mock, its plant and the link to it in one process; time passes only in ``wait`` and ``run``.

    Is itself the CanLink of the driver. ``cut`` is a cable pulled out; ``drop`` swallows that many answers to come;
    from ``dies_at_ns`` on the client gets nothing done any more. ``spoil`` numbers the lines with SDO answers of which
    ``digit`` (counted from the end) arrives as ``becomes``.
    """

    def __init__(self, position_mm: float = 8.0, booted: bool = True, **kind: Any) -> None:
        self.clock_ns = 1_000_000_000
        self.plant = LaggingPlant(position_mm)
        self.wire = MemoryWire()
        self.mock = Epos4Mock(self.wire, self.plant, self.clock_ns, **kind)
        self.decoder, self.health = SlcanDecoder(), BusHealth(1_000_000)
        self.sent: list[CanFrame] = []
        self.cut = False
        self.closed = False
        self.drop = 0
        self.dies_at_ns = NEVER_NS
        self.answers = 0
        self.spoil: set[int] = set()
        self.digit, self.becomes = 1, b"G"
        self.say(b"C\rS8\rO\r")
        self.run(0.1 if booted else 0.0)
        self.wire.sent.clear()

    def open(self, path: str, bitrate: int, now: object) -> "DriveBench":
        self.closed = False
        return self

    def now(self) -> int:
        return self.clock_ns

    def fileno(self) -> int:
        return 99

    def say(self, lines: bytes) -> None:
        """Bytes from the client to the adapter."""
        self.wire.said += lines
        self.mock.receive(self.clock_ns)

    def heard(self) -> bytes:
        """Bytes from the adapter to the client since the last call."""
        return self.wire.take()

    def send(self, *frames: CanFrame) -> None:
        if self.clock_ns >= self.dies_at_ns:
            raise HostDied
        if self.cut:
            raise PortClosed("memory: the CAN adapter is gone (hang-up); check its cable, then connect again")
        self.sent += frames
        self.say(b"".join(map(encode_frame, frames)))

    def read(self) -> list[CanFrame]:
        if self.cut:
            raise PortClosed("memory: the CAN adapter is gone (hang-up); check its cable, then connect again")
        frames = self.decoder.feed(b"".join(map(self._spoilt, self.heard().splitlines(keepends=True))))
        while self.drop and frames:
            frames.pop(0)
            self.drop -= 1
        return frames

    def _spoilt(self, line: bytes) -> bytes:
        self.answers += line.startswith(b"t581")
        if not line.startswith(b"t581") or self.answers not in self.spoil:
            return line
        at = len(line) - 1 - self.digit
        return line[:at] + self.becomes + line[at + 1 :]

    def wait(self, timeout_s: float) -> None:
        end_ns = self.clock_ns + round(timeout_s * 1e9)
        while self.clock_ns < end_ns and not self.wire.sent:
            self._step(end_ns)

    def run(self, time_s: float) -> None:
        """Lets time pass, whatever arrives."""
        end_ns = self.clock_ns + round(time_s * 1e9)
        while self.clock_ns < end_ns:
            self._step(end_ns)

    def close(self) -> None:
        self.closed = True

    def _step(self, end_ns: int) -> None:
        until_ns = min(end_ns, self.clock_ns + MS, max(self.mock.due_ns, self.clock_ns + 1))
        self.plant.advance((until_ns - self.clock_ns) / 1e9)
        self.clock_ns = until_ns
        if self.mock.due_ns <= until_ns:
            self.mock.tick(until_ns)


def remote_drive(*bus: str) -> contextlib.closing[RemoteMock]:
    """The mock in another process until the block ends; ``bus``: group, port and node on udp_multicast."""
    return contextlib.closing(RemoteMock("mock_devices.testing.epos4", *bus))


def multicast_bus(group: str, port: int) -> can.BusABC:
    """A bus that stays on this computer."""
    return can.Bus(interface="udp_multicast", channel=group, port=port, hop_limit=0, ignore_config=True)


def _obey(mock: Epos4Mock, plant: LaggingPlant, order: dict[str, Any]) -> dict[str, object]:
    match order:
        case {"set": "silent", "value": value}:
            mock.silent = value
        case {"set": "frozen", "value": value}:
            mock.frozen = value
        case {"set": "wrong_identity", "value": value}:
            mock.wrong_identity = value
        case {"set": "has_switch", "value": value}:
            plant.has_switch = value
        case {"fault": code, **rest}:
            mock.inject_fault(code, bool(rest.get("lasting")))
        case {"cut": _}:
            mock.close()
    return {"position_mm": plant.position_mm, "powered": plant.powered, "limit_A": plant.current_limit_A}


def serve(*bus: str) -> None:
    """Physics in steps of at most 1 ms up to now, then whatever is due or was said."""
    plant = LaggingPlant()
    moved_ns = time.monotonic_ns()
    on_bus = BusNode(multicast_bus(bus[0], int(bus[1]))) if bus else None
    node = int(bus[2]) if len(bus) > 2 else 1
    mock = Epos4Mock(on_bus or PtyWire(), plant, moved_ns, node, adapter=on_bus)
    while mock.nmt is NmtState.BOOT_UP:
        mock.tick(mock.due_ns)
    say(mock.endpoints())
    while True:
        wait_s = max(0.0, min(mock.due_ns - time.monotonic_ns(), 5 * MS) / 1e9)
        ready, _, _ = select.select([sys.stdin.fileno(), *mock.filenos()], [], [], wait_s)
        now_ns = time.monotonic_ns()
        while moved_ns < now_ns:
            step_ns = min(MS, now_ns - moved_ns)
            plant.advance(step_ns / 1e9)
            moved_ns += step_ns
        if mock.due_ns <= now_ns:
            mock.tick(now_ns)
        if sys.stdin.fileno() in ready:
            line = sys.stdin.readline()
            if not line:
                break
            say(_obey(mock, plant, json.loads(line)))
        elif ready:
            mock.receive(now_ns)
    mock.close()


if __name__ == "__main__":
    serve(*sys.argv[1:])
