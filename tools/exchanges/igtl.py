"""The client reads a tool of the simulated server."""

import time

import pyigtl

from mock_devices.openigtlink.mock import OpenIgtLinkMock
from mock_devices.testing.ndi import TIP, StillPlant
from mock_devices.testing.played import played
from mock_devices.wire import TcpWire


def exchange() -> None:
    """Where the tip is [mm]."""
    since_1970_ns = time.time_ns() - time.monotonic_ns()
    mock = OpenIgtLinkMock(TcpWire(), StillPlant(), ("tip", "arm"), lambda now_ns: now_ns + since_1970_ns)
    with played(mock):
        host, port = mock.endpoints()["tcp"].split(":")
        client = pyigtl.OpenIGTLinkClient(host, int(port))
        tip = client.wait_for_message("tip", timeout=10)
        client.stop()
        client.socket.close()
    assert max(abs(tip.matrix[:3, 3] - TIP[:3])) < 1e-3
