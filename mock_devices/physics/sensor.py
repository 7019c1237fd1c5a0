"""The force sensor: a filter, six channels with zero, cross-talk and noise, a converter with step and range."""

import math
from collections.abc import Iterator

import numpy as np

from mock_devices.parameters import Sensor
from mock_devices.physics import STEP_S
from mock_devices.physics.chain import Chain
from mock_devices.physics.channels import Channels

M_PER_MM = 1e-3
FORCES = ("fx", "fy", "fz")
BLOCK = 1024


def normals(rng: np.random.Generator, width: int) -> Iterator[list[float]]:
    """Rows of ``width`` standard normal numbers, drawn in blocks."""
    while True:
        yield from rng.standard_normal((BLOCK, width)).tolist()


class ForcePlant:
    """SensorPlant of the bench. Channels 0-2 are Fx Fy Fz [N], 3-5 Mx My Mz [N m]."""

    def __init__(self, sensor: Sensor, rng: np.random.Generator) -> None:
        self.temperature_C = sensor.temperature_C
        self.zero = [*sensor.zero_N, *sensor.zero_N_m]
        self.axis = FORCES.index(sensor.axis)
        self.channels = Channels()
        self.lateral_N = 0.0
        self._sensor = sensor
        self._noise = normals(rng, 6)
        self._rms = [sensor.noise_N] * 3 + [sensor.noise_N_m] * 3
        self._quantum = [sensor.quantum_N] * 3 + [sensor.quantum_N_m] * 3
        self._end = [sensor.range_N] * 3 + [sensor.range_N_m] * 3
        self.lean(sensor.lever_mm)
        self._share = -math.expm1(-STEP_S / sensor.filter_s) if sensor.filter_s else 1.0
        self._force_N = self._slope_N_s = self._lag_s = self._time_s = 0.0
        self._chain = Chain()

    def lean(self, lever_mm: float) -> None:
        """The load acts ``lever_mm`` beside the sensor's axis from now on."""
        self._per_N = self._response(lever_mm)

    def _response(self, lever_mm: float) -> list[float]:
        """Each channel's answer to 1 N of compression: the axial one, cross-talk, and the moment of the lever."""
        sign = self._sensor.gain * (1.0 if self._sensor.compression == "positive" else -1.0)
        forces = [sign * (1.0 if channel == self.axis else self._sensor.crosstalk) for channel in range(3)]
        moments = [0.0, 0.0, 0.0]
        moments[(self.axis + 1) % 3] = sign * lever_mm * M_PER_MM
        return forces + moments

    @property
    def time_s(self) -> float:
        """Time simulated, as the converter was told last."""
        return self._time_s

    def step(self, load_N: float) -> None:
        """Lets the filter see the force of one more step."""
        change_N = self._share * (load_N - self._force_N)
        self._force_N += change_N
        self._slope_N_s = change_N / STEP_S

    def publish(self, chain: Chain, time_s: float, lag_s: float) -> None:
        """Tells the converter what time it is: ``lag_s`` after the last step."""
        self._chain, self._time_s, self._lag_s = chain, time_s + lag_s, lag_s

    def wrench(self) -> tuple[float, float, float, float, float, float]:
        """Fx Fy Fz [N], Mx My Mz [N m] as converted now."""
        noise = next(self._noise)
        fx, fy, fz, mx, my, mz = (
            _convert(value + rms * unit, quantum, end)
            for value, rms, unit, quantum, end in zip(
                self._clean(), self._rms, noise, self._quantum, self._ends(), strict=True
            )
        )
        return fx, fy, fz, mx, my, mz

    def overrange(self) -> bool:
        """Whether a channel is at its end now, noise apart."""
        return any(abs(value) >= end for value, end in zip(self._clean(), self._ends(), strict=True))

    def _clean(self) -> list[float]:
        """Channels without noise; also brings the temperature up to date."""
        sensor = self._sensor
        self.temperature_C = sensor.temperature_C - sensor.warm_up_K * math.expm1(-self._time_s / sensor.warm_up_s)
        force_N = self._force_N + self._slope_N_s * self._lag_s
        for convert in self._chain.readings:
            force_N = convert(force_N, self._time_s, self.temperature_C)
        force_N += self.channels.drifted_N(self._time_s)
        loads = self.channels.converted([force_N * per_N for per_N in self._per_N])
        loads[(self.axis + 1) % 3] += sensor.gain * self.lateral_N
        return [load + zero for load, zero in zip(loads, self.zero, strict=True)]

    def _ends(self) -> list[float]:
        end_N = self.channels.end_N
        return [min(end, end_N) for end in self._end[:3]] + self._end[3:]


def _convert(value: float, quantum: float, end: float) -> float:
    value = -end if value < -end else min(value, end)
    return round(value / quantum) * quantum if quantum else value
