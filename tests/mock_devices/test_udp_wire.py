"""The mock's end of UDP against the driver's end: who speaks last is answered, and a pulled plug is nobody there."""

import select
from collections.abc import Iterator

import pytest

from drivers.udp_port import UdpPort
from mock_devices.udp_wire import UdpWire
from rig.errors import DeviceError


@pytest.fixture
def wire() -> Iterator[UdpWire]:
    served = UdpWire()
    yield served
    served.close()


def port_to(wire: UdpWire) -> UdpPort:
    return UdpPort("127.0.0.1", int(wire.endpoint.rpartition(":")[2]))


def heard(end: UdpPort | UdpWire) -> bytes:
    descriptors = end.filenos() if isinstance(end, UdpWire) else [end.fileno()]
    assert select.select(descriptors, [], [], 5)[0]
    return end.read()


def test_whoever_speaks_last_is_the_client(wire: UdpWire) -> None:
    first, second = port_to(wire), port_to(wire)
    wire.write(b"to nobody")
    for port in (first, second):
        port.write(b"start")
        assert heard(wire) == b"start"
    wire.write(b"sample")
    assert (heard(second), first.read()) == (b"sample", b"")
    assert wire.read() == b""
    first.close()
    second.close()


def test_a_pulled_plug_is_nobody_there_and_pushed_in_the_same_address(wire: UdpWire) -> None:
    port = port_to(wire)
    port.write(b"start")
    assert heard(wire) == b"start"
    wire.close()
    wire.write(b"lost")
    assert (wire.filenos(), wire.read()) == ([], b"")
    port.write(b"anybody?")
    with pytest.raises(DeviceError, match="nobody answers there"):
        heard(port)
    wire.plug()
    wire.plug()
    port.write(b"again")
    assert heard(wire) == b"again"
    wire.write(b"here")
    assert heard(port) == b"here"
    port.close()
