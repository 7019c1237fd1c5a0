"""Two nodes on one link: each driver has its own node's frames, whoever reads the bus."""

import os
from collections.abc import Iterator

import pytest

from drivers.can.shared import NodeView, SharedBuses
from drivers.can.slcan import CanFrame
from drivers.epos4.device import Epos4Axis
from drivers.ports import PortClosed
from mock_devices.epos4.mock import Epos4Mock
from mock_devices.testing.epos4 import DriveBench, LaggingPlant
from mock_devices.testing.wire import MemoryWire
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits

Two = tuple[Epos4Axis, Epos4Axis]


class TwoDrives(DriveBench):
    """Nodes 1 and 2 behind one adapter: what the client says, both hear, and only the first one's adapter answers."""

    def __init__(self) -> None:
        self.other_wire, self.other_plant = MemoryWire(), LaggingPlant(12.0)
        self.other = Epos4Mock(self.other_wire, self.other_plant, 1_000_000_000, node=2)
        self.readable = os.eventfd(0, os.EFD_NONBLOCK)
        self.opened = 0
        super().__init__()

    def open(self, path: str, bitrate: int, now: object) -> DriveBench:
        self.opened += 1
        return super().open(path, bitrate, now)

    def fileno(self) -> int:
        return self.readable

    def say(self, lines: bytes) -> None:
        super().say(lines)
        self.other_wire.said += lines
        self.other.receive(self.clock_ns)

    def heard(self) -> bytes:
        lines = self.other_wire.take().split(b"\r")
        return super().heard() + b"".join(line + b"\r" for line in lines if line.startswith(b"t"))

    def _step(self, end_ns: int) -> None:
        before_ns = self.clock_ns
        super()._step(end_ns)
        self.other_plant.advance((self.clock_ns - before_ns) / 1e9)
        while self.other.due_ns <= self.clock_ns:
            self.other.tick(self.other.due_ns)


@pytest.fixture
def bench() -> Iterator[TwoDrives]:
    bench = TwoDrives()
    yield bench
    os.close(bench.readable)


@pytest.fixture
def axes(bench: TwoDrives) -> Iterator[Two]:
    buses = SharedBuses()
    first, second = (
        Epos4Axis(Epos4Wiring(port="memory", node=node), Limits(), bench.now, open_link=buses.opener(node, bench.open))
        for node in (1, 2)
    )
    yield first, second
    first.close()
    second.close()


def test_both_start_and_home_on_a_link_that_is_opened_once(bench: TwoDrives, axes: Two) -> None:
    for axis in axes:
        axis.start()
        axis.home()
    assert bench.opened == 1
    assert abs(bench.plant.position_mm) < 0.1
    assert abs(bench.other_plant.position_mm) < 0.1
    axes[1].move_to(10, 30)
    assert bench.other_plant.position_mm == pytest.approx(10, abs=0.1)
    assert abs(bench.plant.position_mm) < 0.1


def test_samples_of_one_come_whoever_reads_and_none_is_the_others(bench: TwoDrives, axes: Two) -> None:
    first, second = axes
    for axis in axes:
        axis.start()
    bench.plant.position_mm, bench.other_plant.position_mm = 3.0, 40.0
    first.request(bench.now())
    bench.run(0.002)
    assert second.poll(bench.now()) == []
    [sample] = first.poll(bench.now())
    assert sample.position_mm == pytest.approx(3.0 - 8.0, abs=0.01)
    assert first.counters.device_lost == second.counters.device_lost == 0


def test_one_that_leaves_takes_the_bus_from_nobody_and_the_last_closes_it(bench: TwoDrives, axes: Two) -> None:
    first, second = axes
    for axis in axes:
        axis.start()
    first.close()
    left = bench.closed
    second.home()
    second.close()
    assert (left, bench.closed) == (False, True)
    first.start()
    assert bench.opened == 2


def test_a_cut_cable_is_told_to_both(bench: TwoDrives, axes: Two) -> None:
    for axis in axes:
        axis.start()
    bench.cut = True
    for axis in axes:
        with pytest.raises(PortClosed, match="the CAN adapter is gone"):
            axis.poll(bench.now())


def test_frames_for_nobody_are_counted(bench: TwoDrives) -> None:
    buses = SharedBuses()
    link = buses.opener(1, bench.open)("memory", 1_000_000, bench.now)
    assert isinstance(link, NodeView)
    bench.other_wire.take()
    bench.wire.sent.append(b"t183105\rt181105\r")
    assert link.read() == [CanFrame(0x181, b"\x05")]
    assert link.read() == []
    assert link.bus.strange == 1
    link.close()
    link.close()
