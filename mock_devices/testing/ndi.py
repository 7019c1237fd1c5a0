"""The tracker mock for tests: in this process on an injected clock, or in another one in real time.

The other process is ``python -m mock_devices.testing.ndi serial|tcp polaris|vega``. It prints its endpoint as one line
of JSON; each line it reads sets one fault: ``{"fault": "missing", "value": [0]}``; ``cut`` cuts the wire.
"""

import contextlib
import json
import os
import select
import sys
import time
from typing import Any

from drivers.ndi.codec import encode_text
from drivers.ndi.device import NdiTracker
from drivers.ports import PortClosed
from drivers.roles import MarkerTracker
from mock_devices.interfaces import MarkerPose
from mock_devices.ndi.mock import NdiMock
from mock_devices.testing.clock import long_ago
from mock_devices.testing.remote import RemoteMock, say
from mock_devices.testing.wire import MemoryWire
from mock_devices.wire import PtyWire, TcpWire
from rig.channels import MarkerSample
from rig.config.products.ndi_polaris import PolarisWiring

MS = 1_000_000

TIP = MarkerPose(12.25, -34.5, -1000.0, 0.5, -0.5, 0.5, -0.5, 0.125)
ARM = MarkerPose(-250.0, 100.0, -1500.0, 1.0, 0.0, 0.0, 0.0, 0.25)


class StillPlant:
    """Two markers that stay where they are; their numbers are exact in TX and in BX."""

    def __init__(self) -> None:
        self.view: list[MarkerPose | None] = [TIP, ARM]

    def markers(self, now_ns: int) -> list[MarkerPose | None]:
        return self.view


class TrackerBench:
    """A mock and the port to it in one process; frames pass only by ``run_until``.

    ``canned`` answers a command by another text than the mock's. On a serial address bytes at the wrong speed are lost;
    ``speed`` is the tracker's own, and ``heeds_break`` says whether the line carries a break. ``spoil`` numbers the
    replies of which one bit arrives wrong, ``mishear`` the commands of which one does.
    """

    def __init__(self, address: str = "tcp://memory:1", **kind: Any) -> None:
        self.address = address
        self.plant = StillPlant()
        self.wire = MemoryWire()
        self.mock = NdiMock(self.wire, self.plant, start_ns=0, **kind)
        self.canned: dict[str, str] = {}
        self.commands: list[bytes] = []
        self.bauds: list[int] = []
        self.spoil: set[int] = set()
        self.mishear: set[int] = set()
        self.speed = 9600
        self.heeds_break = True
        self.closed = False
        self.cut = False
        self._readable = os.eventfd(0, os.EFD_NONBLOCK)

    def open(self, baud: int) -> "TrackerBench":
        self.bauds.append(baud)
        self.closed = False
        return self

    def run_until(self, now_ns: int) -> None:
        while self.mock.due_ns <= now_ns:
            self.mock.tick(self.mock.due_ns)

    def fileno(self) -> int:
        return self._readable

    def read(self) -> bytes:
        if self.cut:
            raise PortClosed(f"{self.address}: the other end closed the connection")
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._readable)
        return self.wire.take()

    def write(self, data: bytes) -> None:
        if self.cut:
            raise PortClosed(f"{self.address}: the other end closed the connection")
        self.commands.append(data)
        if self.address.startswith("/") and self.bauds[-1] != self.speed:
            return
        name = data.partition(b":")[0].decode()
        if name in self.canned:
            self.wire.sent.append(encode_text(self.canned[name]))
        else:
            self.wire.said += flipped(data) if len(self.commands) in self.mishear else data
            self.mock.receive(0)
            if len(self.commands) in self.spoil:
                self.wire.sent = [flipped(reply) for reply in self.wire.sent]
        if name == "COMM" and len(self.commands) not in self.mishear:
            self.speed = 115200 if data.startswith(b"COMM:5") else 9600
        os.eventfd_write(self._readable, 1)

    def set_baud(self, baud: int) -> None:
        self.bauds.append(baud)

    def send_break(self) -> None:
        self.commands.append(b"<break>")
        if self.heeds_break:
            self.speed = 9600
            self.wire.sent.append(encode_text("RESET"))
            os.eventfd_write(self._readable, 1)

    def close(self) -> None:
        self.closed = True

    def release(self) -> None:
        os.close(self._readable)


def flipped(message: bytes) -> bytes:
    """One bit in its middle the other way round."""
    middle = len(message) // 2
    return message[:middle] + bytes([message[middle] ^ 0x01]) + message[middle + 1 :]


def started(bench: TrackerBench, **settings: Any) -> NdiTracker:
    """The driver on that bench, after its start."""
    device = NdiTracker(bench.open, PolarisWiring(**settings), long_ago)
    device.start()
    return device


def run(bench: TrackerBench, device: MarkerTracker, start_ms: int, end_ms: int) -> list[MarkerSample]:
    """Polls each millisecond, as the loop does."""
    samples: list[MarkerSample] = []
    for tick in range(start_ms, end_ms):
        bench.run_until(tick * MS)
        samples += device.poll(tick * MS)
    return samples


def remote_tracker(link: str = "serial", kind: str = "vega") -> contextlib.closing[RemoteMock]:
    """The mock in another process until the block ends."""
    return contextlib.closing(RemoteMock("mock_devices.testing.ndi", link, kind))


def _set_fault(mock: NdiMock, name: str, value: Any) -> None:
    match name:
        case "silent":
            mock.silent = value
        case "frozen":
            mock.frozen = value
        case "missing":
            mock.missing = set(value)
        case "unplugged":
            mock.unplugged = set(value)
        case "corrupt_every":
            mock.corrupt_every = value
        case "error_reply":
            mock.error_reply = value
        case "strays":
            mock.strays = value
        case "freeze_tag":
            mock.freeze_tag = value
        case "cut":
            mock.close()


def serve(link: str, kind: str) -> None:
    """The mock in this process until its input ends."""
    wire = PtyWire() if link == "serial" else TcpWire()
    mock = NdiMock(wire, StillPlant(), time.monotonic_ns(), kind="vega" if kind == "vega" else "polaris")
    say(mock.endpoints())
    while True:
        wait_s = max(0.0, (mock.due_ns - time.monotonic_ns()) / 1e9)
        ready, _, _ = select.select([sys.stdin.fileno(), *mock.filenos()], [], [], wait_s)
        while mock.due_ns <= time.monotonic_ns():
            mock.tick(mock.due_ns)
        if sys.stdin.fileno() in ready:
            line = sys.stdin.readline()
            if not line:
                break
            order = json.loads(line)
            _set_fault(mock, order["fault"], order["value"])
            say({"set": order["fault"]})
        elif ready:
            mock.receive(time.monotonic_ns())
    mock.close()


if __name__ == "__main__":
    serve(*sys.argv[1:3])
