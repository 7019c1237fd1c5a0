"""UDP: one datagram a read, from the peer alone, and none that is cut passes for a whole one."""

import select
import socket
from collections.abc import Iterator

import pytest

from drivers.ports import open_port
from drivers.udp_port import AT_ONCE, UdpPort, udp_address
from rig.errors import DeviceError


@pytest.fixture
def peer() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far:
        far.bind(("127.0.0.1", 0))
        far.settimeout(5)
        yield far


@pytest.fixture
def port(peer: socket.socket) -> Iterator[UdpPort]:
    near = UdpPort("127.0.0.1", peer.getsockname()[1], largest=8)
    yield near
    near.close()


def heard(port: UdpPort) -> bytes:
    assert select.select([port], [], [], 5)[0]
    return port.read()


def test_what_is_written_is_one_datagram_and_what_is_read_too(port: UdpPort, peer: socket.socket) -> None:
    port.write(b"ask")
    data, where = peer.recvfrom(100)
    assert data == b"ask"
    for answer in (b"one", b"two"):
        peer.sendto(answer, where)
    assert [heard(port), heard(port), port.read()] == [b"one", b"two", b""]


def test_a_datagram_that_is_too_long_is_counted_and_not_handed_on(port: UdpPort, peer: socket.socket) -> None:
    port.write(b"ask")
    _, where = peer.recvfrom(100)
    for answer in (b"123456789", b"12345678"):
        peer.sendto(answer, where)
    assert select.select([port], [], [], 5)[0]
    assert (list(port.datagrams()), port.cut) == ([b"12345678"], 1)


def test_no_stranger_is_heard(port: UdpPort, peer: socket.socket) -> None:
    port.write(b"ask")
    _, where = peer.recvfrom(100)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(b"forged", ("127.0.0.1", where[1]))
    peer.sendto(b"true", where)
    assert (heard(port), port.read()) == (b"true", b"")


def test_a_flood_is_taken_in_portions(port: UdpPort, peer: socket.socket) -> None:
    port.write(b"ask")
    _, where = peer.recvfrom(100)
    for _ in range(AT_ONCE + 5):
        peer.sendto(b"x", where)
    assert (len(list(port.datagrams())), len(list(port.datagrams()))) == (AT_ONCE, 5)


def test_nobody_at_the_other_end_is_said(peer: socket.socket) -> None:
    address = f"udp://127.0.0.1:{peer.getsockname()[1]}"
    peer.close()
    port = open_port(address, 0)
    port.write(b"ask")
    with pytest.raises(DeviceError, match=f"{address}: nobody answers there .*; check address"):
        heard(port)  # type: ignore[arg-type]
    port.close()
    with pytest.raises(DeviceError, match="this end closed the port"):
        port.read()


@pytest.mark.parametrize("wrong", ["udp://:5", "udp://host", "udp://host:0", "udp://host:70000", "tcp://host:5"])
def test_a_wrong_address_is_one_sentence(wrong: str) -> None:
    with pytest.raises(DeviceError, match="not a UDP address; write udp://host:port"):
        udp_address(wrong)


def test_addresses() -> None:
    assert (udp_address("udp://10.0.0.5:49152"), udp_address("udp://[::1]:7")) == (("10.0.0.5", 49152), ("::1", 7))


def test_a_host_nobody_knows_and_a_port_in_use(peer: socket.socket) -> None:
    with pytest.raises(DeviceError, match="cannot be opened"):
        UdpPort("no.such.host.invalid", 5)
    with pytest.raises(DeviceError, match="cannot be opened"):
        UdpPort("127.0.0.1", 5, local_port=peer.getsockname()[1])
