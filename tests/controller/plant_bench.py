"""The whole loop against an axis with motor, drive and lag, and against sensors with filter, latency and noise.

``PlantBench`` is a ``FakeBench`` whose axis is `rig.simulation.axis_plant` (33 Hz, 8 ms behind its set-point) and whose
tissue is a curve. ``true_peak_N`` is the force on the tissue, whatever the sensor and the configuration make of it.
"""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, cast

import numpy as np
import pytest

from controller.devices.drivers import Devices
from controller.loop.bench_loop import BenchLoop
from controller.loop.commands import Inbox
from controller.loop.steps import Approach, Compress, Retract, Step
from controller.safety.table import TABLE, Check
from rig.channel import Channel
from rig.channels import ForceSample
from rig.config.wiring import Wiring
from rig.simulation import axis_plant
from rig.simulation.axis_plant import AxisState, ForceSensing, ModelledLimb, Motor, PositionLoop, at_rest
from tests.calibrations import with_calibration
from tests.controller.fake_bench import SETTLED_CYCLES, ZERO, FakeBench, wired
from tests.controller.fake_devices import FakeAxis, FakeForce, Triple

SURFACE_MM = 20.0
DEEPEST_MM, POINTS = 40.0, 4001
STEP_NS = round(axis_plant.STEP_S * 1e9)


class Product(NamedTuple):
    """A force sensor as its maker describes it: rate, filter, time from capture to arrival, noise and step."""

    rate_Hz: float
    filter_s: float
    latency_ns: int
    noise_N: float
    quantum_N: float
    noise_N_m: float


BOTA = Product(1000.0, 0.0005, 1_500_000, 0.005, 0.001, 0.0002)
FT300 = Product(100.0, 0.003, 10_000_000, 0.05, 0.01, 0.002)
PRODUCTS = pytest.mark.parametrize("product", [BOTA, FT300], ids=["1 kHz", "100 Hz"])
TOUCH = (ZERO, Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0))


def curve(force_N: Callable[[float], float]) -> ModelledLimb:
    """Tissue whose force at a depth [mm] is ``force_N``."""
    depths = np.linspace(0.0, DEEPEST_MM, POINTS)
    return ModelledLimb(tuple(depths), tuple(force_N(depth) for depth in depths), 0.0, surface_mm=SURFACE_MM)


def linear(stiffness_N_mm: float) -> ModelledLimb:
    """F = k x."""
    return curve(lambda depth_mm: stiffness_N_mm * depth_mm)


def exponential(stiffness_N_mm: float, at_N: float, b_per_mm: float = 0.25) -> ModelledLimb:
    """F = a x exp(b x) with a tangent of ``stiffness_N_mm`` where the force is ``at_N``: b + 1 / x = k / F."""
    depth_mm = 1.0 / (stiffness_N_mm / at_N - b_per_mm)
    a_N_mm = at_N / depth_mm * math.exp(-b_per_mm * depth_mm)
    return curve(lambda mm: a_N_mm * mm * math.exp(min(b_per_mm * mm, 12.0)))


@dataclass
class PlantAxis(FakeAxis):
    """The axis as physics; ``limb`` is what its tip meets, shifted by ``surface_mm``."""

    limb: ModelledLimb = field(default_factory=lambda: linear(1.0))
    filter_s: float = BOTA.filter_s
    state: AxisState = field(default_factory=lambda: at_rest(10.0))
    _stepped_ns: int = 0

    def advance(self, now_ns: int) -> None:
        """Steps of an eighth of a millisecond up to ``now_ns``."""
        self._stepped_ns = self._stepped_ns or now_ns
        target_mm = self.state.reference_mm if math.isnan(self.target_mm) else self.target_mm
        while self._stepped_ns < now_ns:
            self.state = axis_plant.step(
                self.state, Motor(), PositionLoop(), self.limb, ForceSensing(self.filter_s), target_mm
            )
            self._stepped_ns += STEP_NS
        self.position_mm = self.state.position_mm

    def _ask(self, now_ns: int) -> None:
        self.advance(now_ns)
        mm_s = self.state.speed_rad_s * Motor().lead_mm / (2 * math.pi)
        self._due.append((now_ns, round(self.position_mm * 2000.0) / 2000.0, mm_s))


@dataclass
class PlantForce(FakeForce):
    """A sensor of a product in front of a ``PlantAxis``, on ``channel`` with compression negative."""

    product: Product = BOTA
    channel: int = 2
    lever_m: float = 0.0015
    disturbed_N: Triple = (0.0, 0.0, 0.0)
    noise: random.Random = field(default_factory=lambda: random.Random(1))

    @property
    def true_N(self) -> float:
        """The tissue's force."""
        assert isinstance(self.axis, PlantAxis)
        return self.axis.state.force_N

    def _sample(self, captured_ns: int) -> ForceSample:
        assert isinstance(self.axis, PlantAxis)
        sensed_N = self.axis.state.sensed_N * self.gain + self.zero_N + self.extra_N(captured_ns)
        number = len(self.samples) + len(self._held)
        along = [-sensed_N if at == self.channel else 0.0 for at in range(3)]
        fx_N, fy_N, fz_N = (self._converted(sum(parts)) for parts in zip(along, self.sideways_N, strict=True))
        mx, my, mz = (moment + self.noise.gauss(0.0, self.product.noise_N_m) for moment in self.moment_N_m)
        fx_N, fy_N, fz_N = (force + more for force, more in zip((fx_N, fy_N, fz_N), self.disturbed_N, strict=True))
        mx -= self.lever_m * self.axis.state.sensed_N
        return ForceSample(
            number, captured_ns, captured_ns, 0, fx_N, fy_N, fz_N, mx, my, mz, math.nan, 0, int(self.valid)
        )

    def _converted(self, force_N: float) -> float:
        step_N = self.product.quantum_N
        return round((force_N + self.noise.gauss(0.0, self.product.noise_N)) / step_N) * step_N


class PlantBench(FakeBench):
    """A bench of one product over ``limb``; ``wiring`` may say wrong things of the sensor."""

    def __init__(
        self,
        product: Product,
        limb: ModelledLimb,
        wiring: Wiring | None = None,
        seed: int = 1,
        table: tuple[Check, ...] = TABLE,
    ) -> None:
        known = with_calibration(
            wiring or wired(product.rate_Hz, tracker=None), PlantForce.__name__, "1", PlantAxis.__name__
        )
        super().__init__(known, position_mm=15.0, settled=0)
        self.axis: PlantAxis = PlantAxis(
            self.clock, self.period_ns, position_mm=15.0, limb=limb, filter_s=product.filter_s, state=at_rest(15.0)
        )
        self.force: PlantForce = PlantForce(
            self.clock, round(1e9 / product.rate_Hz), axis=self.axis, wiring=self.wiring, product=product,
            noise=random.Random(seed), latency_ns=product.latency_ns,
        )  # fmt: skip
        self.devices = Devices(self.force, self.axis, None)
        link = cast(Channel, self.link)
        inbox = Inbox(link, self.responder)
        self.loop = BenchLoop(self.wiring, self.devices, self.ring, link, inbox, self.clock, table)
        self.cycles(SETTLED_CYCLES)


def rammed(speed_mm_s: float) -> tuple[Step, ...]:
    """Finds the surface, goes back 3 mm and presses at full speed, deeper than the force limit lets it."""
    return (
        ZERO,
        Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0),
        Retract(clearance_mm=3.0, speed_mm_s=20.0),
        Compress(depth_mm=15.0, speed_mm_s=speed_mm_s, force_limit_N=15.0),
    )
