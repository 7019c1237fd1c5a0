"""A link that carries but is not well makes its device degraded, in the link's own words."""

import pytest

from controller.devices.connections import of_axis
from controller.devices.health import StreamHealth
from controller.devices.states import DEGRADED_NS, DeviceState, connecting, following
from mock_devices.testing.clock import Clock
from tests.controller.fake_devices import FakeAxis

MS = 1_000_000
TROUBLE = "the CAN bus has 40 errors/s: check terminators and cable"


@pytest.fixture
def health() -> StreamHealth:
    health = StreamHealth(MS, 50 * MS)
    for number in range(60):
        health.update(number * MS, True, number)
    return health


@pytest.mark.parametrize(("trouble", "state"), [("", DeviceState.OK), (TROUBLE, DeviceState.DEGRADED)])
def test_trouble_of_the_bus_is_seen_and_after_a_second_degrades(
    health: StreamHealth, trouble: str, state: DeviceState
) -> None:
    axis = FakeAxis(Clock(), MS)
    axis.counters.trouble = trouble
    status = connecting(0)
    for now_ns in (60 * MS, 60 * MS + DEGRADED_NS, 60 * MS + 2 * DEGRADED_NS):
        health.update(now_ns, True, now_ns)
        status = following(status, of_axis(health, "", axis, now_ns), now_ns)
    assert status.state is state
    assert trouble in status.detail
