"""The choice of an adapter, its bad inputs, and python-can's link on a bus that stays in this process."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import can
import pytest

from drivers.can.generic import PythonCanLink, open_bus
from drivers.can.health import BusState
from drivers.can.slcan import CanFrame
from drivers.can.socketcan import FULL_LARGEST
from drivers.ports import PortClosed
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.table import parse
from rig.config.wiring import Wiring
from rig.errors import DeviceError, UsageError

PATIENCE_S = 5.0


@pytest.fixture
def buses() -> Iterator[tuple[can.BusABC, PythonCanLink]]:
    theirs = can.Bus(interface="virtual", channel="adapters", ignore_config=True)
    link = PythonCanLink(open_bus("virtual", "adapters", 1_000_000, {}), "virtual adapters", 1_000_000)
    yield theirs, link
    link.close()
    theirs.shutdown()


def read(link: PythonCanLink, count: int) -> list[CanFrame]:
    frames: list[CanFrame] = []
    deadline = time.monotonic() + PATIENCE_S
    while len(frames) < count and time.monotonic() < deadline:
        link.wait(0.1)
        frames += link.read()
    return frames


def eventually(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def test_frames_of_every_kind_go_both_ways(buses: tuple[can.BusABC, PythonCanLink]) -> None:
    theirs, link = buses
    frames = [CanFrame(0x181, b"\x01\x02"), CanFrame(0x1234567, bytes(8), True), CanFrame(0x701, bytes(1), False, True)]
    link.send(*frames)
    heard = [theirs.recv(PATIENCE_S) for _ in frames]
    assert [(got.arbitration_id, got.is_extended_id, got.is_remote_frame) for got in heard if got] == [
        (0x181, False, False), (0x1234567, True, False), (0x701, False, True)
    ]  # fmt: skip
    for message in heard:
        theirs.send(message)  # type: ignore[arg-type]
    assert read(link, 3) == frames
    assert link.decoder.frames == 3


def test_error_frames_are_counted_and_are_no_frames(buses: tuple[can.BusABC, PythonCanLink]) -> None:
    theirs, link = buses
    theirs.send(can.Message(is_error_frame=True))
    theirs.send(can.Message(arbitration_id=0x80, is_extended_id=False))
    assert read(link, 1) == [CanFrame(0x80)]
    assert link.decoder.error_frames == 1


class BadBus(can.BusABC):
    """A bus whose library raises, goes off, or takes no more frames, as it is told."""

    def __init__(self) -> None:
        super().__init__(0)
        self.fails: Exception | None = None
        self.now, self.full = can.BusState.ACTIVE, True

    @property
    def state(self) -> can.BusState:
        return self.now

    @state.setter
    def state(self, state: can.BusState) -> None:
        self.now = state

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        time.sleep(0.01)
        if self.fails:
            raise self.fails
        return None, True

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.full:
            raise can.CanOperationError("transmit queue full")


@pytest.fixture
def bad() -> Iterator[tuple[BadBus, PythonCanLink]]:
    bus = BadBus()
    link = PythonCanLink(bus, "pcan PCAN_USBBUS1", 1_000_000)
    yield bus, link
    link.close()


def gone(link: PythonCanLink) -> str:
    with pytest.raises(PortClosed) as told:
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            link.wait(0.1)
            link.read()
    return str(told.value)


def test_bus_off_and_an_adapter_that_is_gone_end_the_link_in_one_sentence(bad: tuple[BadBus, PythonCanLink]) -> None:
    bus, link = bad
    bus.now = can.BusState.PASSIVE
    eventually(lambda: link.decoder.state is BusState.PASSIVE)
    assert "error passive" in link.health.trouble
    bus.now = can.BusState.ERROR
    assert gone(link).startswith("pcan PCAN_USBBUS1: the CAN bus is gone (its controller went off the bus")


def test_what_the_adapters_library_raises_in_the_thread_is_told_where_the_bus_is_read(
    bad: tuple[BadBus, PythonCanLink],
) -> None:
    bus, link = bad
    bus.fails = RuntimeError("device detached")
    assert "device detached" in gone(link)


def test_a_transmit_queue_that_is_full_is_counted_and_ends_the_link_when_it_stays_so(
    bad: tuple[BadBus, PythonCanLink],
) -> None:
    bus, link = bad
    for _ in range(FULL_LARGEST - 1):
        link.send(CanFrame(0x80))
    bus.full = False
    link.send(CanFrame(0x80))
    bus.full = True
    for _ in range(FULL_LARGEST - 1):
        link.send(CanFrame(0x80))
    assert link.decoder.refused == 2 * (FULL_LARGEST - 1)
    with pytest.raises(PortClosed, match=r"^pcan PCAN_USBBUS1: .* takes no more frames: transmit queue full.; check"):
        link.send(CanFrame(0x80))


@pytest.mark.parametrize(
    ("interface", "port"), [("pcan", "PCAN_USBBUS1"), ("kvaser", "0"), ("ixxat", "0"), ("gs_usb", "0")]
)
def test_an_adapter_that_is_not_there_is_one_sentence_with_the_next_step(interface: str, port: str) -> None:
    with pytest.raises(DeviceError, match=rf"^{interface} {port}: python-can cannot open the adapter: .*; check"):
        open_bus(interface, port, 1_000_000, {})


@pytest.mark.parametrize(
    ("axis", "told"),
    [
        ({"interface": "pcan"}, "port: name PEAK's name of the channel for pcan, for example PCAN_USBBUS1"),
        ({"interface": "socketcan"}, "port: name the network interface, set up and running for socketcan"),
        ({"interface": "kvaser", "port": "can0"}, "port: 'can0' is not the number of the channel; for example 0"),
        (
            {"interface": "pcan", "port": "PCAN_USBBUS1", "adapter": {"speed": 1}},
            "adapter.speed: .* takes no such option",
        ),
        ({"interface": "pcan", "port": "P", "adapter": {"device_id": "x"}}, "adapter.device_id: 'x' is no int"),
        ({"interface": "pcan", "port": "P", "adapter": {"device_id": True}}, "adapter.device_id: True is no int"),
        ({"interface": "canusb"}, "axis.interface: Input should be 'slcan', 'socketcan', 'pcan'"),
        ({"bitrate": 0}, "axis.bitrate: Input should be greater than 0"),
    ],
)
def test_a_wrong_choice_names_key_bound_and_example(axis: dict[str, Any], told: str) -> None:
    with pytest.raises(UsageError, match=told):
        parse(Wiring, {"axis": axis}, "rig.toml")


def test_options_of_the_adapter_are_taken_from_its_own_table() -> None:
    axis = {"interface": "udp_multicast", "port": "239.74.163.2", "adapter": {"port": 43_120, "hop_limit": 0}}
    wiring = parse(Wiring, {"axis": axis}, "rig.toml")
    assert isinstance(wiring.axis, Epos4Wiring)
    assert wiring.axis.adapter == {"port": 43_120, "hop_limit": 0}
