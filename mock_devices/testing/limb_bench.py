"""A limb under a perfect axis: F = a x exp(b x) + B v in contact, sensed with the noise and rate of either sensor."""

import math
from dataclasses import dataclass, field

from controller.loop.steps import Approach, Zero
from mock_devices.testing.spring_bench import SURFACE_MM, SpringBench
from rig.config.wiring import Wiring


@dataclass(frozen=True)
class Limb:
    """The study's law; stiffness at contact in N/mm, stiffening per mm, viscosity in N s/mm."""

    a_N_mm: float = 0.12
    b_per_mm: float = 0.22
    damping_N_s_mm: float = 0.01

    def force_N(self, depth_mm: float, speed_mm_s: float) -> float:
        """Never pulls."""
        if depth_mm <= 0:
            return 0.0
        elastic_N = self.a_N_mm * depth_mm * math.exp(self.b_per_mm * depth_mm)
        return max(elastic_N + self.damping_N_s_mm * speed_mm_s, 0.0)


@dataclass(frozen=True)
class Sensor:
    """Noise of one sample, milliseconds between samples, and the converter's step, as the data sheets have them."""

    noise_N: float
    every: int
    quantum_N: float


BOTA = Sensor(0.005, 1, 0.001)
FT300 = Sensor(0.05, 10, 0.01)


@dataclass
class LimbBench(SpringBench):
    """The spring bench with a limb and a sensor of its own; a millisecond a cycle."""

    limb: Limb = field(default_factory=Limb)
    sensor: Sensor = BOTA
    deepest_mm: float = 0.0

    def __post_init__(self) -> None:
        self.every = self.sensor.every
        super().__post_init__()

    def tissue_N(self, moved_mm: float) -> float:
        """The limb's force at the speed of the last millisecond."""
        depth_mm = self.position_mm - SURFACE_MM
        self.deepest_mm = max(self.deepest_mm, depth_mm)
        return self.limb.force_N(depth_mm, moved_mm / 0.001)

    def converted_N(self, force_N: float) -> float:
        """With the sensor's noise and step."""
        sensor = self.sensor
        return round((force_N + self.noise.gauss(0.0, sensor.noise_N)) / sensor.quantum_N) * sensor.quantum_N


def approached(
    limb: Limb, sensor: Sensor, seed: int, touches: int = 3, friction_N: float = 0.0, wiring: Wiring | None = None
) -> LimbBench:
    """One approach as a capture makes it, to its end, from somewhere 2 to 3 mm above the limb."""
    bench = LimbBench(wiring or Wiring(), limb=limb, sensor=sensor, position_mm=SURFACE_MM - 3.0, friction_N=friction_N)
    bench.noise.seed(seed)
    bench.position_mm += bench.noise.random()
    bench.sense()
    bench.run(
        Zero(duration_s=0.5), Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0, touches=touches),
        cycles=200_000,
    )  # fmt: skip
    return bench
