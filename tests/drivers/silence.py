"""When a sensor has said all that was under way."""

import select
import time

from drivers.roles import ForceSensor
from mock_devices.testing.force import WAIT_S

QUIET_S = 0.2


def await_silence(sensor: ForceSensor) -> None:
    """Waits until what was under way has come and nothing follows; a driver that raises at silence fails here."""
    deadline = time.monotonic() + WAIT_S
    while sensor.poll(time.monotonic_ns()) or select.select([sensor.fileno()], [], [], QUIET_S)[0]:
        assert time.monotonic() < deadline, "the sensor does not fall silent"
    assert list(sensor.poll(time.monotonic_ns())) == []
