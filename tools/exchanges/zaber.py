"""The maker's library asks the simulated axis, which moves."""

import time

from zaber_motion.ascii import Connection

from mock_devices.bench import Bench
from mock_devices.parameters import Parameters
from mock_devices.testing.played import played
from mock_devices.wire import TcpWire
from mock_devices.zaber.mock import ZaberMock


def exchange() -> None:
    """Homes, and reads its place."""
    bench, wire = Bench(Parameters(), start_ns=time.monotonic_ns()), TcpWire()
    host, port = wire.endpoint.split(":")
    mock = ZaberMock(wire, bench.axis, bench.now_ns)
    with played(mock, bench.advance), Connection.open_tcp(host, int(port)) as connection:
        axis = connection.get_device(1).get_axis(1)
        axis.home()
        axis.move_absolute(2000)
        assert abs(axis.get_position() - 2000) < 60
