"""The simulated Zaber axis on the bench's physics and a line with a speed, on a clock in the test's hand."""

import contextlib
import os
from typing import Any

from drivers.ports import PortClosed
from drivers.zaber.device import ZaberAxis
from mock_devices.bench import Bench
from mock_devices.parameters import Parameters
from mock_devices.testing.clock import Clock
from mock_devices.testing.wire import MemoryWire
from mock_devices.zaber.mock import ZaberMock
from rig.config.products.zaber_ascii import ZaberWiring
from rig.config.wiring import Limits

MS = 1_000_000
# While the driver waits for a reply, time goes on by what a short dialogue takes.
DIALOGUE_MS = 4


class ZaberBench:
    """Port and physics; while ``baud`` is 0 an answer is there at once, and each command takes 4 ms."""

    address = "/dev/zaber"

    def __init__(self, **parameters: Any) -> None:
        self.clock = Clock()
        self.bench = Bench(Parameters.model_validate(parameters), start_ns=self.clock.now_ns)
        self.wire = MemoryWire()
        self.mock = ZaberMock(self.wire, self.bench.axis, self.clock.now_ns)
        self.commands: list[bytes] = []
        self.baud, self.cut = 0, False
        self._under_way: list[tuple[int, bytes]] = []
        self._coming: list[tuple[int, bytes]] = []
        self._arrived = b""
        self._readable = os.eventfd(0, os.EFD_NONBLOCK)

    def axis(self, limits: Limits | None = None, loop_Hz: float = 1000.0, **settings: Any) -> ZaberAxis:
        """A driver at this port, not yet started."""
        config = ZaberWiring.model_validate({"port": self.address} | settings)
        return ZaberAxis(lambda: self, config, limits or Limits(), loop_Hz, now=self.clock, sleep=self.sleep)

    def sleep(self, seconds: float) -> None:
        """Lets the bench go on for a while."""
        self.run_until(self.clock.now_ns + round(seconds * 1e9))

    def run_until(self, until_ns: int) -> None:
        """Everything up to a time: what is on the line arrives, the axis moves."""
        while self.clock.now_ns < until_ns:
            self.clock.now_ns = min(self.clock.now_ns + MS // 4, until_ns)
            self._deliver(self.clock.now_ns)
            if self.mock.due_ns <= self.clock.now_ns:
                self.bench.advance(self.mock.due_ns)
                self.mock.tick(self.mock.due_ns)
            self.bench.advance(self.clock.now_ns)

    def _deliver(self, now_ns: int) -> None:
        while self._under_way and self._under_way[0][0] <= now_ns:
            self._tell(*self._under_way.pop(0))
        while self._coming and self._coming[0][0] <= now_ns:
            self._arrived += self._coming.pop(0)[1]

    def _tell(self, at_ns: int, data: bytes) -> None:
        self.wire.said += data
        self.mock.receive(at_ns)
        for reply in self.wire.sent:
            free_ns = max(at_ns, self._coming[-1][0] if self._coming else 0)
            self._coming.append((free_ns + self._on_line_ns(reply), reply))
        self.wire.sent.clear()

    def _on_line_ns(self, data: bytes) -> int:
        return len(data) * 10_000_000_000 // self.baud if self.baud else 0

    def fileno(self) -> int:
        return self._readable

    def read(self) -> bytes:
        self._check()
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._readable)
        arrived, self._arrived = self._arrived, b""
        return arrived

    def write(self, data: bytes) -> None:
        self._check()
        lines = data.splitlines(keepends=True)
        self.commands += lines
        at_ns = self.clock.now_ns
        for line in lines:
            at_ns += self._on_line_ns(line)
            self._under_way.append((at_ns, line))
        if not self.baud:
            self.run_until(self.clock.now_ns + DIALOGUE_MS * MS)
            os.eventfd_write(self._readable, 1)

    def _check(self) -> None:
        if self.cut:
            raise PortClosed(f"{self.address}: the line is gone; check the cable")

    def set_baud(self, baud: int) -> None:
        raise AssertionError("nothing changes the baud")

    def send_break(self) -> None:
        raise AssertionError("nothing sends a break")

    def close(self) -> None:
        """The bench goes on."""


def homed(bench: ZaberBench, **settings: Any) -> ZaberAxis:
    """The driver on that bench, started and homed."""
    axis = bench.axis(**settings)
    axis.start()
    axis.home()
    return axis
