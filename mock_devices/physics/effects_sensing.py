"""Effects between tip and number: the guide in front of the sensor, the sensor, and the time stamps."""

import math
from collections import deque
from dataclasses import dataclass, field

from mock_devices.physics import STEP_S
from mock_devices.physics.chain import Conversion, Guide, Late, Sensing, knob

KG_MM_S2_TO_N = 1e-3
HOUR_S = 3600.0


@dataclass
class Friction(Guide):
    """Dahl friction of the guide between sensor and tip: dz/dx = (1 - sgn(v) z) / l, force level x z, in air too."""

    level_N: float = knob(0.2, 0, 5, "Coulomb level")
    slip_length_mm: float = knob(0.05, 0.001, 2, "l, travel after a reversal before the force has turned")
    _z: float = field(default=0.0, init=False)

    def __call__(self, moved_mm: float, _acceleration_mm_s2: float) -> float:
        """Newtons against the motion."""
        if moved_mm:
            side = math.copysign(1.0, moved_mm)
            self._z = side - (side - self._z) * math.exp(-abs(moved_mm) / self.slip_length_mm)
        return self.level_N * self._z


@dataclass
class TipInertia(Guide):
    """The mass in front of the sensor pushes on it when it is accelerated into the tissue."""

    mass_kg: float = knob(0.1, 0, 2, "mass in front of the sensor")

    def __call__(self, _moved_mm: float, acceleration_mm_s2: float) -> float:
        """Newtons of inertia."""
        return self.mass_kg * acceleration_mm_s2 * KG_MM_S2_TO_N


@dataclass
class Cogging(Guide):
    """Magnets of a linear motor pull by themselves: A (sin(2 pi x / p) + 0.3 sin(4 pi x / p + 1)), in air too."""

    level_N: float = knob(0.1, 0, 5, "A")
    period_mm: float = knob(2.0, 0.2, 50, "pitch of the magnets")
    _way_mm: float = field(default=0.0, init=False)

    def __call__(self, moved_mm: float, _acceleration_mm_s2: float) -> float:
        """Newtons along the axis."""
        self._way_mm += moved_mm
        turn = math.tau * self._way_mm / self.period_mm
        return self.level_N * (math.sin(turn) + 0.3 * math.sin(2 * turn + 1))


@dataclass
class CrossTalk(Guide):
    """A cable is drawn out by the axis and pulls on the sensor, with the square of the way, in air too."""

    level_N: float = knob(0.2, -5, 5, "after 10 mm")
    _way_mm: float = field(default=0.0, init=False)

    def __call__(self, moved_mm: float, _acceleration_mm_s2: float) -> float:
        """Newtons of the cable."""
        self._way_mm += moved_mm
        return self.level_N * (self._way_mm / 10) ** 2


@dataclass
class SensorHysteresis(Sensing):
    """A sensor's body remembers: falling forces read more, by plays of several widths (Kuhnen 2003)."""

    level_N: float = knob(0.2, 0, 5, "reading on the way down over that on the way up")
    width_N: float = knob(0.5, 0.005, 50, "mean fall of force that brings it out")

    BRANCHES = (0.8, 0.9, 1.0, 1.1, 1.2)  # widths, in shares of their mean

    def __post_init__(self) -> None:
        self._followers = [0.0] * len(self.BRANCHES)

    def __call__(self, force_N: float) -> float:
        """The force with what is remembered."""
        widths = (self.width_N * share for share in self.BRANCHES)
        pairs = zip(self._followers, widths, strict=True)
        self._followers = [min(max(place_N, force_N), force_N + width_N) for place_N, width_N in pairs]
        ahead_N = sum(self._followers) / len(self._followers) - force_N
        return force_N + self.level_N * ahead_N / self.width_N


@dataclass
class FilterLag(Sensing):
    """A first-order low-pass in the force channel."""

    time_constant_s: float = knob(0.01, 0.0005, 0.5, "time constant")
    _force_N: float = field(default=0.0, init=False)

    def __call__(self, force_N: float) -> float:
        """The force behind the filter."""
        self._force_N += -math.expm1(-STEP_S / self.time_constant_s) * (force_N - self._force_N)
        return self._force_N


@dataclass
class TimeOffset(Sensing):
    """The force comes late against the position."""

    delay_s: float = knob(0.008, 0, 0.2, "how late")

    def __post_init__(self) -> None:
        steps = max(round(self.delay_s / STEP_S), 0)
        self._line: deque[float] = deque([0.0] * steps)

    def __call__(self, force_N: float) -> float:
        """The force of ``delay_s`` ago."""
        self._line.append(force_N)
        return self._line.popleft()


@dataclass
class ClockDrift(Sensing):
    """The force's clock runs fast: its stamps come later and later against the position's."""

    gain_ppm: float = knob(500.0, 0, 5000, "seconds gained in a million")
    _steps: int = field(default=0, init=False)

    LONGEST_STEPS = round(0.2 / STEP_S)

    def __post_init__(self) -> None:
        self._past: deque[float] = deque([0.0, 0.0], maxlen=self.LONGEST_STEPS)

    def __call__(self, force_N: float) -> float:
        """The force of the time that the clock has come to be late by."""
        self._past.append(force_N)
        self._steps += 1
        late = min(1e-6 * self.gain_ppm * self._steps, len(self._past) - 2.0)
        whole = int(late)
        newer, older = self._past[-1 - whole], self._past[-2 - whole]
        return newer + (late - whole) * (older - newer)


@dataclass
class GainError(Conversion):
    """A wrong calibration: force x (1 + e)."""

    gain: float = knob(0.05, -0.5, 0.5, "e")

    def __call__(self, force_N: float, _time_s: float, _temperature_C: float) -> float:
        """The force as converted."""
        return force_N * (1 + self.gain)


@dataclass
class Temperature(Conversion):
    """The gain follows the sensor's temperature: force x (1 + k (T - T0))."""

    gain_per_K: float = knob(0.02, -0.2, 0.2, "k")
    reference_C: float = knob(25.0, -20, 80, "T0")

    def __call__(self, force_N: float, _time_s: float, temperature_C: float) -> float:
        """The force as converted."""
        return force_N * (1 + self.gain_per_K * (temperature_C - self.reference_C))


@dataclass
class ZeroDrift(Conversion):
    """The zero wanders with the time of the session."""

    rate_N_h: float = knob(3.0, -100, 100, "compression shown per hour without any")

    def __call__(self, force_N: float, time_s: float, _temperature_C: float) -> float:
        """The force as converted."""
        return force_N + self.rate_N_h * time_s / HOUR_S


@dataclass
class TrackerLatency(Late):
    """The camera is later than it states."""

    delay_s: float = knob(0.03, 0, 0.4, "how much later")
