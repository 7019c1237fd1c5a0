import random
import time
from pathlib import Path

import pytest

from drivers.ports import PortClosed, SerialPort, TcpPort, read_until
from mock_devices.bench import Bench
from mock_devices.devices import DeviceFactory
from mock_devices.faults.wires import WIRE_FAULTS, FaultyWire, as_number, faults_of
from mock_devices.interfaces import NEVER_NS
from mock_devices.parameters import Parameters
from mock_devices.played import ALL, CHOICES, made
from mock_devices.testing.clock import Clock
from mock_devices.testing.wire import MemoryWire
from mock_devices.wire import PtyWire, TcpWire
from rig.errors import DeviceError, UsageError


@pytest.fixture
def inside() -> MemoryWire:
    return MemoryWire("here")


@pytest.fixture
def clock() -> Clock:
    return Clock(0)


@pytest.fixture
def wire(inside: MemoryWire, clock: Clock) -> FaultyWire:
    return FaultyWire(inside, random.Random(1), clock)


def inject(wire: FaultyWire, kind: str, value: bool | float | None = None) -> None:
    fault = faults_of(wire, WIRE_FAULTS)[kind]
    fault.apply(fault.default if value is None else value)


def test_a_wire_without_faults_passes_everything_at_once_both_ways(wire: FaultyWire, inside: MemoryWire) -> None:
    inside.said = b"C"
    wire.write(b"\xaa\x01")
    assert wire.read() == b"C"
    assert inside.sent == [b"\xaa\x01"]
    assert wire.due_ns == NEVER_NS
    assert wire.endpoint == "here"


def test_a_frozen_wire_passes_nothing_either_way_until_it_is_healed(wire: FaultyWire, inside: MemoryWire) -> None:
    inject(wire, "freeze")
    inside.said = b"C"
    wire.write(b"lost")
    assert wire.read() == b""
    inject(wire, "heal")
    wire.write(b"there")
    assert inside.sent == [b"there"]
    assert not inside.closed


def test_dropping_loses_the_share_asked_for(wire: FaultyWire, inside: MemoryWire) -> None:
    inject(wire, "drop", 0.25)
    for number in range(4000):
        wire.write(bytes([number % 256]))
    assert 0.22 < 1 - len(inside.sent) / 4000 < 0.28


def test_corruption_flips_one_bit_in_the_share_asked_for_and_keeps_the_length(
    wire: FaultyWire, inside: MemoryWire
) -> None:
    inject(wire, "corrupt", 0.5)
    for _ in range(1000):
        wire.write(b"\x55" * 37)
    flipped = [sum((byte ^ 0x55).bit_count() for byte in data) for data in inside.sent]
    assert set(flipped) == {0, 1}
    assert 400 < sum(flipped) < 600
    assert {len(data) for data in inside.sent} == {37}


def test_truncation_shortens_messages_to_a_beginning_of_themselves(wire: FaultyWire, inside: MemoryWire) -> None:
    inject(wire, "truncate", 1.0)
    for _ in range(100):
        wire.write(b"0123456789")
    assert all(len(data) < 10 and b"0123456789".startswith(data) for data in inside.sent)
    assert len({len(data) for data in inside.sent}) > 5


def test_garbage_stands_in_front_of_a_whole_message(wire: FaultyWire, inside: MemoryWire) -> None:
    inject(wire, "garbage", 1.0)
    wire.write(b"message")
    assert inside.sent[0].endswith(b"message")
    assert len(inside.sent[0]) == len(b"message") + 23


def test_delayed_messages_arrive_in_order_when_their_time_has_come(
    wire: FaultyWire, inside: MemoryWire, clock: Clock
) -> None:
    inject(wire, "delay", 0.05)
    wire.write(b"first")
    clock.now_ns = 10_000_000
    wire.write(b"second")
    assert wire.due_ns == 50_000_000
    wire.tick(49_999_999)
    assert inside.sent == []
    wire.tick(50_000_000)
    assert inside.sent == [b"first"]
    assert wire.due_ns == 60_000_000
    inject(wire, "heal")
    clock.now_ns = 60_000_000
    wire.write(b"third")
    wire.tick(60_000_000)
    assert inside.sent == [b"first", b"second", b"third"]


def test_a_cut_pty_is_a_hang_up_for_the_client() -> None:
    wire = FaultyWire(PtyWire(), random.Random(1), time.monotonic_ns)
    port = SerialPort(wire.endpoint, 460800)
    wire.write(b"alive")
    assert read_until(port, lambda data: data == b"alive", 2.0) == b"alive"
    inject(wire, "cut")
    with pytest.raises(PortClosed, match="the line is gone"):
        port.read()
    wire.write(b"nobody")
    assert wire.filenos() == []
    port.close()


def test_a_cut_connection_is_closed_for_the_client() -> None:
    wire = FaultyWire(TcpWire(), random.Random(1), time.monotonic_ns)
    host, _, number = wire.endpoint.partition(":")
    port = TcpPort(host, int(number))
    wire.read()
    inject(wire, "cut")
    with pytest.raises(PortClosed):
        read_until(port, bool, 2.0)
    port.close()


@pytest.mark.parametrize("value", [1.5, -0.1, True, "much"])
def test_a_share_outside_zero_to_one_is_refused(wire: FaultyWire, value: bool | float | str) -> None:
    with pytest.raises(UsageError, match="a number from 0 to 1"):
        WIRE_FAULTS["drop"].apply(wire, value)
    assert as_number(1, 0, 1) == 1.0


def test_every_device_has_every_wire_fault_and_its_own_and_takes_each_at_its_default() -> None:
    bench = Bench(Parameters.model_validate({"tracker": {"tcp_port": 0}}))
    every = [product for choices in CHOICES.values() for product in choices[ALL]]
    devices = made(every, DeviceFactory(bench, 0, lambda: 0, seed=0))
    named = {mock[1:3] for choices in CHOICES.values() for product in choices[ALL] if (mock := product.mock)}
    assert {(device.role, kind) for device in devices for kind in device.mock.endpoints()} >= named
    for device in devices:
        assert set(WIRE_FAULTS) | {"silent", "frozen"} <= set(device.faults)
        before = vars(device.mock).keys() | vars(device.wire).keys()
        for fault in device.faults.values():
            fault.apply(fault.default)
        assert vars(device.mock).keys() | vars(device.wire).keys() == before  # a slip of a name would add an attribute
        assert device.wire.filenos() == []


def test_a_serial_line_is_found_under_its_link_again_after_an_unplug(tmp_path: Path) -> None:
    line = PtyWire(tmp_path / "force")
    wire = FaultyWire(line, random.Random(1), time.monotonic_ns)
    port = SerialPort(wire.endpoint, 115200)
    inject(wire, "unplug")
    assert not (tmp_path / "force").exists()
    with pytest.raises(PortClosed):
        port.read()
    with pytest.raises(DeviceError, match="cannot be opened"):
        SerialPort(wire.endpoint, 115200)
    inject(wire, "unplug", False)
    inject(wire, "unplug", False)
    again = SerialPort(wire.endpoint, 115200)
    wire.write(b"here")
    assert read_until(again, lambda data: data == b"here", 2.0) == b"here"
    port.close()
    again.close()
    wire.close()
    assert not list(tmp_path.iterdir())


def test_a_port_listens_again_after_an_unplug() -> None:
    wire = FaultyWire(TcpWire(), random.Random(1), time.monotonic_ns)
    host, _, number = wire.endpoint.partition(":")
    inject(wire, "unplug")
    with pytest.raises(DeviceError, match="no connection"):
        TcpPort(host, int(number))
    inject(wire, "unplug", False)
    TcpPort(host, int(number)).close()
    wire.close()


def test_a_line_without_a_lasting_name_and_a_wire_without_a_plug_refuse(wire: FaultyWire) -> None:
    line = FaultyWire(PtyWire(), random.Random(1), time.monotonic_ns)
    inject(line, "unplug")
    with pytest.raises(UsageError, match="serve with --links"):
        inject(line, "unplug", False)
    with pytest.raises(UsageError, match="has no plug"):
        inject(wire, "unplug", False)
