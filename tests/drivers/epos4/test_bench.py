"""The servo axis over a real serial line: python-can opens it, the mock drive runs in another process."""

import contextlib
import math
import os
import pty
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from typing import Any

import pytest

from drivers.can.bus import SlcanLink
from drivers.can.slcan import CanFrame
from drivers.epos4 import objects
from drivers.epos4.device import Epos4Axis
from drivers.epos4.node import Node
from drivers.ports import PortClosed, SerialPort
from mock_devices.testing.epos4 import remote_drive
from mock_devices.testing.remote import RemoteMock
from rig.channels import AxisSample
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits
from rig.errors import DeviceError, UsageError

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("wire")]
PATIENCE_S = 10.0
HEARTBEAT_MS = 1000
TURN_S = 0.002
MOVING_HOST = """
import sys, time
from drivers.epos4.device import Epos4Axis
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits
axis = Epos4Axis(Epos4Wiring(port=sys.argv[1], heartbeat_ms=200), Limits())
axis.start()
axis.home()
axis.enable()
print("moving", flush=True)
position_mm = 0.0
while True:
    time.sleep(0.002)
    axis.poll(time.monotonic_ns())
    position_mm = min(position_mm + 0.02, 59.0)
    axis.command(position_mm, time.monotonic_ns())
"""


@pytest.fixture
def mock() -> Iterator[RemoteMock]:
    with remote_drive() as mock:
        yield mock


@pytest.fixture
def axis(mock: RemoteMock) -> Iterator[Epos4Axis]:
    axis = Epos4Axis(config_of(mock), Limits())
    axis.start()
    yield axis
    axis.close()


def config_of(mock: RemoteMock, **config: Any) -> Epos4Wiring:
    """Heartbeats are slow here: a shared machine may stop any process for a while."""
    return Epos4Wiring(port=mock.address, heartbeat_ms=HEARTBEAT_MS, **config)


def turn(axis: Epos4Axis, position_mm: float) -> list[AxisSample]:
    """One turn of a loop at about 500 Hz."""
    time.sleep(TURN_S)
    samples = axis.poll(time.monotonic_ns())
    axis.command(position_mm, time.monotonic_ns())
    return list(samples)


def turn_until_fault(axis: Epos4Axis) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not axis.fault:
        assert time.monotonic() < deadline, "no fault came"
        turn(axis, 0.0)


def at_rest(mock: RemoteMock, axis: Epos4Axis) -> dict[str, Any]:
    """The carriage's state once it stands still."""
    deadline = time.monotonic() + PATIENCE_S
    before, now = {"position_mm": math.inf}, mock.order(ask=True)
    while abs(now["position_mm"] - before["position_mm"]) > 1e-6:
        assert time.monotonic() < deadline, "the axis does not come to rest"
        for _ in range(10):
            turn(axis, 10.0)
        before, now = now, mock.order(ask=True)
    return now


def test_homing_a_profile_move_and_a_sine(mock: RemoteMock, axis: Epos4Axis) -> None:
    assert axis.identity.product == "maxon EPOS4 61500000"
    axis.home()
    assert abs(mock.order(ask=True)["position_mm"]) < 0.1
    axis.move_to(20, 40)
    axis.enable()
    samples: list[AxisSample] = []
    for number in range(750):
        samples += turn(axis, 20 + 2 * math.sin(2 * math.pi * number * TURN_S))
    assert axis.enabled
    assert axis.counters.device_lost == 0
    assert axis.counters.discarded_bytes == 0
    assert [sample.seq for sample in samples] == list(range(len(samples)))
    assert all(sample.valid and sample.capture_ns <= sample.arrival_ns for sample in samples)
    positions = [sample.position_mm for sample in samples]
    assert min(positions) < 18.3
    assert max(positions) > 21.7


def test_a_fault_is_named_and_reset(mock: RemoteMock, axis: Epos4Axis) -> None:
    axis.home()
    axis.enable()
    mock.order(fault=0x2310)
    turn_until_fault(axis)
    assert axis.fault == "0x2310 overcurrent"
    assert not mock.order(ask=True)["powered"]
    axis.reset_fault()
    axis.enable()
    assert axis.enabled
    assert axis.fault == ""


def test_a_quick_stop_holds_the_axis_where_it_is(mock: RemoteMock, axis: Epos4Axis) -> None:
    axis.home()
    axis.enable()
    for step in range(200):
        turn(axis, step * 0.05)
    axis.quick_stop()
    for _ in range(100):
        turn(axis, 10.0)
    first = at_rest(mock, axis)
    for _ in range(50):
        turn(axis, 30.0)
    second = mock.order(ask=True)
    assert first["powered"]
    assert second["position_mm"] == pytest.approx(first["position_mm"], abs=1e-3)


def test_a_drive_stops_by_itself_when_the_host_is_killed(mock: RemoteMock) -> None:
    host = subprocess.Popen([sys.executable, "-c", MOVING_HOST, mock.address], stdout=subprocess.PIPE, text=True)
    try:
        assert host.stdout is not None
        assert host.stdout.readline() == "moving\n"
        deadline = time.monotonic() + PATIENCE_S
        while mock.order(ask=True)["position_mm"] < 2.0:
            assert time.monotonic() < deadline, "the host did not move the axis"
            time.sleep(0.01)
    finally:
        host.send_signal(signal.SIGKILL)
        host.wait(PATIENCE_S)
        if host.stdout:
            host.stdout.close()
    link = SlcanLink(mock.address, 1_000_000)
    try:
        node = Node(link, 1, 126, 1000, "the drive")
        deadline = time.monotonic() + PATIENCE_S
        while node.read(objects.ERROR_CODE) != 0x8130:
            assert time.monotonic() < deadline, "the drive did not notice"
        while node.read(objects.STATUSWORD) & 0x4F != 0x08:
            assert time.monotonic() < deadline, "the drive did not stop"
        first = node.read(objects.POSITION)
        time.sleep(0.1)
        assert node.read(objects.POSITION) == first
        assert 2.0 * 2000 * 0.9 < first < 59 * 2000
    finally:
        link.close()


def test_a_cut_cable_ends_in_one_sentence(mock: RemoteMock, axis: Epos4Axis) -> None:
    axis.home()
    axis.enable()
    turn(axis, 0.0)
    mock.order(cut=True)
    with pytest.raises(DeviceError, match=rf"{mock.address}: the CAN adapter is gone \(.*\); check its cable"):
        for _ in range(100):
            turn(axis, 0.0)
    axis.close()


def test_a_second_session_is_refused_before_it_disturbs_the_first(mock: RemoteMock, axis: Epos4Axis) -> None:
    axis.home()
    axis.enable()
    with pytest.raises(DeviceError, match=rf"{mock.address}: is in use by another session; close that one first"):
        Epos4Axis(config_of(mock), Limits()).start()
    with pytest.raises(DeviceError, match="cannot be opened"):
        SerialPort(mock.address, 115200)
    for _ in range(20):
        turn(axis, 0.0)
    assert axis.enabled
    assert axis.counters.device_lost == 0


def test_after_closing_the_port_is_free_again(mock: RemoteMock, axis: Epos4Axis) -> None:
    axis.home()
    axis.close()
    assert not mock.order(ask=True)["powered"]
    again = Epos4Axis(config_of(mock), Limits())
    again.start()
    assert again.fault == ""
    again.close()


def test_another_device_and_a_silent_one_are_told_apart(mock: RemoteMock) -> None:
    mock.order(set="wrong_identity", value=True)
    with pytest.raises(DeviceError, match="is not a maxon EPOS4"):
        Epos4Axis(config_of(mock), Limits()).start()
    mock.order(set="silent", value=True)
    with pytest.raises(DeviceError, match="does not answer: reading object 1018:01"):
        Epos4Axis(config_of(mock), Limits()).start()


def test_a_wrong_bit_rate_is_a_silent_drive(mock: RemoteMock) -> None:
    with pytest.raises(DeviceError, match="does not answer"):
        Epos4Axis(config_of(mock, bitrate=500_000), Limits()).start()


def test_a_bit_rate_no_adapter_has_is_refused(mock: RemoteMock) -> None:
    with pytest.raises(UsageError, match=r"axis.bitrate 123: the adapter cannot do it; choose one of 10000, "):
        Epos4Axis(config_of(mock, bitrate=123), Limits()).start()


def test_a_port_that_is_not_there_or_no_line_is_one_sentence(tmp_path: Any) -> None:
    with pytest.raises(DeviceError, match=r"/dev/nowhere: cannot be opened: No such file"):
        SlcanLink("/dev/nowhere", 1_000_000)
    plain = tmp_path / "file"
    plain.write_text("no line")
    with pytest.raises(DeviceError, match="is not a serial port"):
        SlcanLink(str(plain), 1_000_000)


def test_a_line_where_nobody_answers_is_no_adapter() -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    try:
        with pytest.raises(DeviceError, match=r"no CAN adapter answers: asked for its version \(V\) and got nothing"):
            SlcanLink(os.ttyname(slave), 1_000_000)
    finally:
        os.close(master)
        os.close(slave)


def test_a_line_on_which_another_device_streams_is_no_adapter() -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    over = threading.Event()

    def stream() -> None:
        while not over.wait(0.001):
            with contextlib.suppress(BlockingIOError):
                os.write(master, bytes.fromhex("AA0000000080BF"))

    os.set_blocking(master, False)
    thread = threading.Thread(target=stream)
    thread.start()
    try:
        with pytest.raises(DeviceError, match=r"this is not a CAN adapter: asked for its version \(V\) and got "):
            SlcanLink(os.ttyname(slave), 1_000_000)
    finally:
        over.set()
        thread.join()
        os.close(master)
        os.close(slave)


def test_a_link_speaks_frames_both_ways_and_says_when_it_is_gone(mock: RemoteMock) -> None:
    link = SlcanLink(mock.address, 1_000_000)
    try:
        link.send(CanFrame(0x601, bytes.fromhex("4018100100000000")))
        frames: list[CanFrame] = []
        deadline = time.monotonic() + PATIENCE_S
        while not frames and time.monotonic() < deadline:
            link.wait(0.1)
            frames += link.read()
        assert frames == [CanFrame(0x581, bytes.fromhex("43181001FB000000"))]
        mock.order(cut=True)
        with pytest.raises(PortClosed, match="the CAN adapter is gone"):
            for _ in range(100):
                link.wait(0.01)
                link.read()
    finally:
        link.close()
        link.close()
