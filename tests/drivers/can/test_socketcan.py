"""SocketCAN's frames by literal bytes, and the link over a pair of SEQPACKET sockets in place of a kernel with CAN.

The bytes are those that candump and python-can's own socketcan module exchange with the kernel on a little-endian
machine (linux/can.h).
"""

import errno
import socket
import subprocess
import sys
from collections.abc import Iterator
from types import SimpleNamespace

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.health import BusState
from drivers.can.opening import opener
from drivers.can.slcan import CanFrame
from drivers.can.socketcan import (
    FULL_LARGEST,
    ErrorFrame,
    SocketCanLink,
    decode,
    encode,
    open_socket,
    refuse_other_rate,
    shown_by_ip,
)
from drivers.epos4.device import Epos4Axis
from drivers.ports import PortClosed
from mock_devices.testing.epos4 import DriveBench
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits
from rig.errors import DeviceError

pytestmark = pytest.mark.skipif(sys.byteorder != "little", reason="the literal bytes are those of such a machine")
FRAMES = [
    (CanFrame(0x601, bytes.fromhex("4018100100000000")), "01060000 08000000 4018100100000000"),
    (CanFrame(0x080), "80000000 00000000 0000000000000000"),
    (CanFrame(0x1234567, b"\xaa", extended=True), "67452381 01000000 aa00000000000000"),
    (CanFrame(0x701, bytes(1), remote=True), "01070040 01000000 0000000000000000"),
]
ERRORS = {
    "bus off": ("40000020 08000000 0000000000000000", BusState.OFF),
    "passive": ("04000020 08000000 0020000000000000", BusState.PASSIVE),
    "warning": ("04000020 08000000 0008000000000000", BusState.WARNING),
    "active again": ("04000020 08000000 0040000000000000", BusState.ACTIVE),
    "restarted": ("00010020 08000000 0000000000000000", BusState.ACTIVE),
    "no acknowledge": ("20000020 08000000 0000000000000000", BusState.WARNING),
}
FRAME = st.builds(
    lambda wide, can_id, data, remote: CanFrame(can_id if wide else can_id & 0x7FF, data, wide, remote),
    st.booleans(), st.integers(0, (1 << 29) - 1), st.binary(max_size=8), st.just(False),
)  # fmt: skip


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, SocketCanLink]]:
    ours, bus = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    link = SocketCanLink(ours, "can0", 1_000_000)
    yield bus, link
    link.close()
    bus.close()


@pytest.mark.parametrize(("frame", "wire"), FRAMES)
def test_frames_are_the_kernels_bytes(frame: CanFrame, wire: str) -> None:
    assert encode(frame) == bytes.fromhex(wire)
    assert decode(bytes.fromhex(wire)) == frame


@given(frame=FRAME)
def test_python_can_reads_what_we_write_and_we_read_what_it_writes(frame: CanFrame) -> None:
    message = can.Message(arbitration_id=frame.can_id, data=frame.data, is_extended_id=frame.extended)
    theirs = build_can_frame(message)
    assert encode(frame) == theirs[:7] + b"\0" + theirs[8:]  # the eighth byte is for lengths that only CAN FD has
    can_id, size, _flags, data = dissect_can_frame(encode(frame))
    assert (can_id & 0x1FFFFFFF, data[:size]) == (frame.can_id, frame.data)
    assert decode(theirs) == frame


@given(raw=st.binary(max_size=20))
def test_any_bytes_are_a_frame_an_error_or_nothing(raw: bytes) -> None:
    found = decode(raw)
    assert found is None or isinstance(found, ErrorFrame) or decode(encode(found)) == found


def test_what_is_no_classical_frame_is_not_sent() -> None:
    with pytest.raises(ValueError, match="not a classical CAN frame"):
        encode(CanFrame(0x800))
    with pytest.raises(ValueError, match="not a classical CAN frame"):
        encode(CanFrame(0x1, bytes(9)))


def test_the_link_carries_frames_both_ways(pair: tuple[socket.socket, SocketCanLink]) -> None:
    bus, link = pair
    link.send(FRAMES[0][0], FRAMES[1][0])
    assert [bus.recv(100) for _ in range(2)] == [bytes.fromhex(wire) for _, wire in FRAMES[:2]]
    assert link.read() == []
    for _, wire in FRAMES:
        bus.send(bytes.fromhex(wire))
    link.wait(1.0)
    assert link.read() == [frame for frame, _ in FRAMES]
    bus.send(b"short")
    assert link.read() == []
    assert (link.decoder.frames, link.decoder.discarded_bytes) == (4, 5)


@pytest.mark.parametrize("name", [name for name in ERRORS if name != "bus off"])
def test_error_frames_are_counted_and_move_the_state(pair: tuple[socket.socket, SocketCanLink], name: str) -> None:
    bus, link = pair
    wire, state = ERRORS[name]
    link.decoder.state = BusState.WARNING
    bus.send(bytes.fromhex(wire))
    assert link.read() == []
    assert (link.decoder.error_frames, link.decoder.state) == (1, state)


def test_bus_off_ends_the_link_in_one_sentence(pair: tuple[socket.socket, SocketCanLink]) -> None:
    bus, link = pair
    bus.send(bytes.fromhex(ERRORS["bus off"][0]))
    with pytest.raises(PortClosed, match=r"^can0: the CAN bus is gone \(its controller went off .*\); check bit"):
        link.read()


class FullSocket:
    """A socket whose send buffer has no room, as on a bus where nobody acknowledges."""

    def fileno(self) -> int:
        return 0

    def setblocking(self, flag: bool) -> None:
        pass

    def send(self, data: bytes) -> int:
        raise OSError(errno.ENOBUFS, "No buffer space available")


def test_a_full_send_buffer_is_counted_and_ends_the_link_when_it_lasts() -> None:
    link = SocketCanLink(FullSocket(), "can0", 1_000_000)  # type: ignore[arg-type]
    link.send(*[FRAMES[0][0]] * (FULL_LARGEST - 1))
    assert link.decoder.refused == FULL_LARGEST - 1
    with pytest.raises(PortClosed, match=r"its send buffer stays full, as no node acknowledges"):
        link.send(FRAMES[0][0])


def test_an_interface_that_goes_away_is_one_sentence(pair: tuple[socket.socket, SocketCanLink]) -> None:
    bus, link = pair
    bus.close()
    with pytest.raises(PortClosed, match="can0: the CAN bus is gone"):
        link.send(FRAMES[0][0])


def test_a_kernel_or_interface_without_can_is_one_sentence() -> None:
    with pytest.raises(DeviceError, match=r"^can7: (this kernel has no CAN|cannot be opened: No such device)"):
        open_socket("can7")
    with pytest.raises(DeviceError, match=r"^can7: "):
        Epos4Axis(Epos4Wiring(interface="socketcan", port="can7"), Limits()).start()


def shown(kind: str, data: str) -> str:
    """As `ip -details -json link show can0` prints it: print_linkinfo of ip/ipaddress.c, can_print_opt of
    ip/iplink_can.c (github.com/iproute2/iproute2)."""
    info = f'"info_kind":"{kind}"' + (f',"info_data":{{{data}}}' if data else "")
    return (
        '[{"ifindex":3,"ifname":"can0","flags":["NOARP","UP","LOWER_UP","ECHO"],"mtu":16,"qdisc":"pfifo_fast",'
        '"operstate":"UP","linkmode":"DEFAULT","group":"default","txqlen":10,"link_type":"can","promiscuity":0,'
        f'"allmulti":0,"min_mtu":0,"max_mtu":0,"linkinfo":{{{info}}},"num_tx_queues":1,"num_rx_queues":1}}]'
    )


def timed(bitrate: int) -> str:
    return shown(
        "can",
        f'"state":"ERROR-ACTIVE","berr_counter":{{"tx":0,"rx":0}},"restart_ms":100,"bittiming":{{"bitrate":{bitrate},'
        '"sample_point":"0.875","tq":125,"prop_seg":6,"phase_seg1":7,"phase_seg2":2,"sjw":1,"brp":1},"bittiming_const":'
        '{"name":"mcp251x","tseg1":{"min":3,"max":16},"tseg2":{"min":2,"max":8},"sjw":{"min":1,"max":4},'
        '"brp":{"min":1,"max":64},"brp_inc":1},"clock":8000000',
    )


FIXED = '"state":"ERROR-ACTIVE","restart_ms":0,"bittiming_bitrate":{},"bitrate_const":[100000,500000],"clock":48000000'
OTHER_RATES = {"timed": timed(500_000), "fixed": shown("can", FIXED.format(500_000)), "near": timed(980_000)}
NO_OTHER_RATE = {
    "the same": timed(1_000_000),
    "as near as the clock divides": timed(1_006_711),
    "virtual": shown("vcan", ""),
    "not set up": shown("can", '"state":"STOPPED","restart_ms":0,"clock":8000000'),
    "fixed, not set up": shown("can", FIXED.format(0)),
    "another link": '[{"ifname":"lo","link_type":"loopback"}]',
    "no such link": "",
    "busybox": "ip: unrecognized option: json",
}


@pytest.mark.parametrize("name", OTHER_RATES)
def test_an_interface_at_another_rate_is_refused_before_it_is_opened(name: str) -> None:
    real = {"near": 980_000}.get(name, 500_000)
    asked: list[str] = []

    def show(interface: str) -> str:
        asked.append(interface)
        return OTHER_RATES[name]

    axis = Epos4Wiring(interface="socketcan", port="can0")
    with pytest.raises(DeviceError) as told:
        Epos4Axis(axis, Limits(), open_link=opener(axis, show)).start()
    assert str(told.value) == (
        f"can0: the interface is set to {real} bit/s where axis.bitrate is 1000000; correct axis.bitrate, or"
        " `ip link set can0 down`, then `ip link set can0 up type can bitrate 1000000`"
    )
    assert asked == ["can0"]


@pytest.mark.parametrize("name", NO_OTHER_RATE)
def test_an_interface_at_the_stated_rate_or_without_one_passes(name: str) -> None:
    refuse_other_rate("can0", 1_000_000, lambda _: NO_OTHER_RATE[name])


def test_what_the_system_says_of_an_interface_is_asked_for_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []

    def run(command: list[str], **_: object) -> SimpleNamespace:
        asked.append(command)
        return SimpleNamespace(stdout="[]")

    with monkeypatch.context() as here:
        here.setattr(subprocess, "run", run)
        assert shown_by_ip("can7") == "[]"
    assert asked == [["ip", "-details", "-json", "link", "show", "can7"]]
    assert "can7" not in shown_by_ip("can7")
    monkeypatch.setenv("PATH", "")
    assert shown_by_ip("lo") == ""


def test_the_axis_starts_and_homes_over_kernel_frames() -> None:
    """The drive mock behind the codec: each frame of either side goes through the 16 bytes."""
    bench = DriveBench()

    class Framed:
        """The bench, with every frame taken to the kernel's bytes and back."""

        decoder, health = bench.decoder, bench.health
        fileno, wait, close = bench.fileno, bench.wait, bench.close

        def send(self, *frames: CanFrame) -> None:
            bench.send(*[back for frame in frames if isinstance(back := decode(encode(frame)), CanFrame)])

        def read(self) -> list[CanFrame]:
            return [back for frame in bench.read() if isinstance(back := decode(encode(frame)), CanFrame)]

    axis = Epos4Axis(Epos4Wiring(port="memory"), Limits(), bench.now, open_link=lambda *_: Framed())
    axis.start()
    axis.home()
    assert axis.referenced
    axis.close()
