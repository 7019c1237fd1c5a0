"""A reading is of the samples taken while it lasted, however busy the computer is that fetches them."""

import itertools

import pytest

from controller.commissioning.readings import read
from drivers.roles import ForceSensor
from mock_devices.testing.clock import Clock
from rig.channels import ForceSample
from rig.errors import DeviceError

MS_NS = 1_000_000
LOADED_NS = 300 * MS_NS


class Sampling:
    """A sensor of 1 kHz that is under 1 N from 0.3 s on, and the computer that sleeps longer than asked."""

    def __init__(self, *stalls_ms: int, silent: bool = False) -> None:
        self.clock, self._taken_ns = Clock(0), 0
        self._stalls_ms, self._silent = itertools.chain(stalls_ms, itertools.repeat(1)), silent

    def sleep(self, _: float) -> None:
        self.clock.now_ns += next(self._stalls_ms) * MS_NS

    def poll(self, now_ns: int) -> list[ForceSample]:
        taken = [] if self._silent else range(self._taken_ns, now_ns, MS_NS)
        self._taken_ns = max(now_ns, self._taken_ns)
        return [
            ForceSample(0, at_ns, now_ns, 0, 0.0, 0.0, float(at_ns >= LOADED_NS), 0.0, 0.0, 0.0, 25.0, 0, 1)
            for at_ns in taken
        ]

    def read(self) -> tuple[float, int]:
        """The mean along z, and of how many samples, of 0.12 s after 0.3 s of rest."""
        sensor: ForceSensor = self  # type: ignore[assignment]
        reading = read(sensor, "bota-sensone", 0.12, 0.3, self.clock, self.sleep)
        return reading.mean[2], reading.samples


@pytest.mark.parametrize("stalls_ms", [(), (290,), (350,), (290, 140), (1, 400), (299, 200)])
def test_a_stall_neither_cuts_a_reading_short_nor_brings_what_was_before(stalls_ms: tuple[int, ...]) -> None:
    assert Sampling(*stalls_ms).read() == (1.0, 120)


def test_a_sensor_that_says_nothing_for_a_second_is_silent() -> None:
    sensor = Sampling(silent=True)
    with pytest.raises(DeviceError, match="bota-sensone gave 0 samples, 8 are needed"):
        sensor.read()
    assert sensor.clock.now_ns == pytest.approx(1420 * MS_NS, abs=2 * MS_NS)
