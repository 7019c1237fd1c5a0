"""The axis on a bus by python-can's udp_multicast, on which every sender hears itself; the drive in another process."""

import os
import time
from collections.abc import Iterator
from typing import Any

import pytest

from drivers.can.shared import BUSES, view_of
from drivers.epos4 import objects
from drivers.epos4.device import Epos4Axis
from drivers.epos4.node import Node
from mock_devices.testing.epos4 import remote_drive
from mock_devices.testing.remote import RemoteMock
from rig.channels import AxisSample
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits
from rig.errors import DeviceError

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("wire")]
GROUP = "239.74.163.2"


@pytest.fixture
def port() -> int:
    """Of this run alone: what is sent to a port, everybody on this computer hears."""
    return 20_000 + os.getpid() % 30_000


@pytest.fixture
def mock(port: int) -> Iterator[RemoteMock]:
    with remote_drive(GROUP, str(port)) as mock:
        yield mock


def config_of(port: int, **config: Any) -> Epos4Wiring:
    options: dict[str, bool | int | str] = {"port": port, "hop_limit": 0}
    return Epos4Wiring(interface="udp_multicast", port=GROUP, adapter=options, heartbeat_ms=500, **config)


def test_homing_a_move_and_samples(mock: RemoteMock, port: int) -> None:
    axis = Epos4Axis(config_of(port), Limits())
    axis.start()
    try:
        axis.home()
        axis.move_to(10, 40)
        # The drive says that a target is reached where its profile ends, and the axis follows by its lag.
        assert mock.order(ask=True)["position_mm"] == pytest.approx(10, abs=0.2)
        axis.enable()
        samples: list[AxisSample] = []
        for _ in range(300):
            time.sleep(0.002)
            samples += axis.poll(time.monotonic_ns())
            axis.command(10.0, time.monotonic_ns())
        assert len(samples) > 250
        assert axis.counters.device_lost == 0
        assert axis.counters.trouble == ""
    finally:
        axis.close()


def test_another_node_of_the_same_bus_is_spoken_to_beside_the_axis(mock: RemoteMock, port: int) -> None:
    """As it stands in rig.toml: the axis shares its adapter, and who else is behind it asks for a view."""
    with remote_drive(GROUP, str(port), "2"):
        axis = Epos4Axis(config_of(port, shared=True), Limits())
        axis.start()
        link = view_of(config_of(port, node=2))(GROUP, 1_000_000, time.monotonic_ns)
        try:
            assert BUSES.buses[GROUP].link is not link
            assert len(BUSES.buses[GROUP].views) == 2
            beside = Node(link, 2, 126, 500, "the other node")
            assert beside.read(objects.VENDOR) == 0xFB
            beside.write(objects.TARGET, 4711)
            axis.home()
            assert beside.read(objects.TARGET) == 4711
        finally:
            link.close()
            axis.close()
        assert BUSES.buses[GROUP].empty


def test_an_axis_that_does_not_share_has_its_adapter_for_itself(mock: RemoteMock, port: int) -> None:
    axis = Epos4Axis(config_of(port), Limits())
    axis.start()
    try:
        assert GROUP not in BUSES.buses or BUSES.buses[GROUP].empty
    finally:
        axis.close()


def test_a_bus_without_a_drive_names_what_to_check(port: int) -> None:
    with pytest.raises(DeviceError, match=r"does not answer: .*; check its power, .*, axis.node and axis.bitrate"):
        Epos4Axis(config_of(port + 1), Limits()).start()
