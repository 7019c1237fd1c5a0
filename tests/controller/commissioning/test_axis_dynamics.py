"""The axis identified on axes whose response is known: by a closed form, by the mock's physics, by the plant's."""

import contextlib
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from api.cli import mock_dynamics
from api.operations import calibrate_dynamics
from api.operations.calibrate_dynamics import axis_dynamics
from controller.commissioning.axis_dynamics import identify, response_of
from controller.commissioning.sweep import AirSweep, amplitude_mm, offset_mm, sweep_for
from controller.commissioning.sweep_moves import LOOK_NS, SweepRun, refuse_outside
from controller.devices.drivers import Devices
from controller.operation import Operation
from drivers.roles import ForceSensor, Identity, LinkCounters, ServoAxis
from mock_devices.parameters import Axis
from mock_devices.physics import STEP_S
from mock_devices.physics.drive_plant import DrivePlant
from rig.channels import AxisSample, ForceSample
from rig.config.axis_dynamics import AxisDynamics
from rig.config.products.cia402 import Cia402Wiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits, Loop, Wiring
from rig.errors import CheckFailed, DeviceError, RigError, SafetyStop, UsageError
from rig.simulation import axis_plant
from rig.simulation.axis_plant import ForceSensing, ModelledLimb, Motor, PositionLoop, at_rest

NOW = datetime(2026, 3, 1, 9, 0, tzinfo=UTC)
DRIVE = Identity("EPOS4", "A1", "0x0170")
CYCLE_NS, HOME_MM = 1_000_000, 5.0
COUNT_MM = 0.0005


class Mechanics:
    """Two lags and a pure delay, each set-point held: solved in steps of 50 us; the base of the axes below."""

    step_ns = 50_000

    def __init__(
        self, lag1_s: float = 0.003, lag2_s: float = 0.005, delay_s: float = 0.0015, gain: float = 1.0
    ) -> None:
        self._shares = [-math.expm1(-self.step_ns * 1e-9 / lag_s) for lag_s in (lag1_s, lag2_s)]
        self._late = deque([HOME_MM] * (round(delay_s * 1e9 / self.step_ns) + 1))
        self._gain = gain
        self._first = self.position_mm = HOME_MM

    def advance(self, target_mm: float) -> None:
        """One step."""
        self._late.append(HOME_MM + self._gain * (target_mm - HOME_MM))
        self._first += self._shares[0] * (self._late.popleft() - self._first)
        self.position_mm += self._shares[1] * (self._first - self.position_mm)


class MockMechanics(Mechanics):
    """The simulated drive of the mock bench: its own physics."""

    step_ns = round(STEP_S * 1e9)

    def __init__(self, axis: Axis) -> None:
        self._plant, self._told_mm = DrivePlant(axis.model_copy(update={"start_mm": HOME_MM})), HOME_MM
        self._plant.power(True)
        self.position_mm = HOME_MM

    def advance(self, target_mm: float) -> None:
        """One step of the plant; a new set-point is told once."""
        if target_mm != self._told_mm:
            self._told_mm = target_mm
            self._plant.target(target_mm)
        self.position_mm, _ = self._plant.step(0.0)


class PlantMechanics(Mechanics):
    """The axis of the simulation."""

    step_ns = round(axis_plant.STEP_S * 1e9)

    def __init__(self) -> None:
        self._state = at_rest(HOME_MM)
        self.position_mm = HOME_MM

    def advance(self, target_mm: float) -> None:
        """One step of the plant, in the air."""
        limb = ModelledLimb((0.0, 1.0), (0.0, 1.0), 0.0, surface_mm=50.0)
        self._state = axis_plant.step(self._state, Motor(), PositionLoop(), limb, ForceSensing(), target_mm)
        self.position_mm = self._state.position_mm


@dataclass
class SweptAxis:
    """A drive on ``mechanics``; a set-point is followed ``late_cycles`` later; ``shaken_mm`` is noise of its place."""

    mechanics: Mechanics = field(default_factory=Mechanics)
    late_cycles: int = 0
    shaken_mm: float = 0.0
    fault: str = ""
    frozen_after: int = 10**9
    identity: Identity = DRIVE
    counters: LinkCounters = field(default_factory=LinkCounters)
    braked: bool = False
    noise: np.random.Generator = field(default_factory=lambda: np.random.default_rng(2))
    _due: deque[float] = field(default_factory=deque)
    _samples: list[AxisSample] = field(default_factory=list)
    _target_mm: float = HOME_MM
    _moved_ns: int = 0
    _commands: int = 0

    def _advance(self, now_ns: int) -> None:
        while self._moved_ns and now_ns - self._moved_ns >= self.mechanics.step_ns:
            self.mechanics.advance(self._target_mm)
            self._moved_ns += self.mechanics.step_ns
        self._moved_ns = self._moved_ns or now_ns

    def poll(self, now_ns: int) -> Sequence[AxisSample]:
        """What was asked for since the last call."""
        found, self._samples = self._samples, []
        return found if self._commands < self.frozen_after else []

    def request(self, now_ns: int) -> None:
        """The place of this moment, as the encoder counts it."""
        self._advance(now_ns)
        shaken_mm = self.mechanics.position_mm + self.shaken_mm * float(self.noise.standard_normal())
        counted_mm = round(shaken_mm / COUNT_MM) * COUNT_MM
        self._samples.append(AxisSample(0, now_ns, now_ns, counted_mm, 0.0, 0.1, 0, 1))

    def command(self, position_mm: float, now_ns: int) -> None:
        """A set-point."""
        self.request(now_ns)
        self._commands += 1
        self._due.append(position_mm)
        if len(self._due) > self.late_cycles:
            self._target_mm = self._due.popleft()

    def quick_stop(self) -> None:
        """Noted."""
        self.braked = True


@dataclass
class AirSensor:
    """A force sensor of 1 kHz whose newest sample is ``age_ns`` old; ``touch_N`` presses from ``touch_after`` on."""

    age_ns: int = 700_000
    touch_N: float = 0.0
    touch_after: int = 10**9
    seq: int = 0
    period_ns: int = CYCLE_NS

    def poll(self, now_ns: int) -> Sequence[ForceSample]:
        """What was taken a millisecond after the one before, and has come; of several at once the newest."""
        newest = (now_ns - self.age_ns) // CYCLE_NS
        if newest <= self.seq:
            return []
        self.seq = newest
        force_N = 0.8 - (self.touch_N if newest > self.touch_after else 0.0)
        return [ForceSample(newest, newest * CYCLE_NS, now_ns, 0, 0, 0, force_N, 0, 0, 0, math.nan, 0, 1)]


class SweptBench:
    """A clock that each sleep sets; ``jitter_ns`` is how late a sleep comes back, ``stall`` cycles sleep 3 ms."""

    def __init__(self, axis: SweptAxis | None = None, jitter_ns: int = 20_000, stall: int = 0) -> None:
        self.axis, self.force = axis or SweptAxis(), AirSensor()
        self._now_ns, self._random = CYCLE_NS, np.random.default_rng(1)
        self._jitter_ns, self._stall, self._cycles = jitter_ns, stall, 0
        self.wiring, self.stopped_after = Wiring(), 10**9

    def now(self) -> int:
        """Monotonic ns."""
        return self._now_ns

    def sleep(self, due_ns: int) -> None:
        """Late by chance."""
        self._cycles += 1
        stalled_ns = 3 * CYCLE_NS if self._stall and self._cycles % self._stall == 0 else 0
        self._now_ns = due_ns + int(self._random.exponential(self._jitter_ns)) + stalled_ns

    def found(self, sweep: AirSweep | None = None) -> AxisDynamics:
        """Swept and identified."""
        sweep = sweep or sweep_for(self.wiring, 0.5, 4, 2)
        devices = Devices(cast(ForceSensor, self.force), cast(ServoAxis, self.axis), None)
        stopped = lambda: self._cycles > self.stopped_after  # noqa: E731
        followed = SweepRun(devices, self.wiring, sweep, stopped, self.now, self.sleep).played()
        return identify(DRIVE, self.wiring, sweep, followed, NOW, "here")


def within(found: AxisDynamics, delay_s: float, lags_s: tuple[float, float]) -> None:
    """Delay, lags and their sum lie in the intervals stated, and these are as narrow as is asked."""
    total_s = delay_s + sum(lags_s)
    assert found.doubts == []
    assert found.delay.s == pytest.approx(delay_s, abs=found.delay.within_s)
    assert found.total.s == pytest.approx(total_s, abs=found.total.within_s)
    for one, lag_s in zip((found.lag1, found.lag2), sorted(lags_s), strict=True):
        assert one.s == pytest.approx(lag_s, abs=one.within_s)


@pytest.mark.parametrize(
    ("delay_s", "lags_s"), [(0.0015, (0.003, 0.005)), (0.0005, (0.002, 0.008)), (0.004, (0.003, 0.003))]
)
def test_a_delay_and_two_lags_are_found_within_their_intervals(delay_s: float, lags_s: tuple[float, float]) -> None:
    found = SweptBench(SweptAxis(Mechanics(*lags_s, delay_s))).found()
    # A step of 50 us is held: half of it later than the closed form.
    within(found, delay_s + 25e-6, lags_s)
    assert found.gain == pytest.approx(1.0, abs=0.01)
    assert found.coherence > 0.98
    assert found.misfit < 0.02


def test_what_the_force_sensor_adds_is_declared_and_measured() -> None:
    found = SweptBench().found()
    assert found.force_filter_s == 0.0005
    # Seen when it arrives or one look later, and by a clock that comes back late.
    assert 0.0007 <= found.force_age_s <= 0.0007 + LOOK_NS * 1e-9 + 50e-6
    assert found.response.delay_s == pytest.approx(found.delay.s + 0.0005 + 0.0005 + found.force_age_s, abs=1e-6)


def test_a_cycle_that_is_dropped_is_a_millisecond_of_delay() -> None:
    one, other = SweptBench().found(), SweptBench(SweptAxis(late_cycles=1)).found()
    assert other.total.s - one.total.s == pytest.approx(0.001, abs=one.total.within_s + other.total.within_s)
    assert other.delay.s - one.delay.s == pytest.approx(0.001, abs=one.delay.within_s + other.delay.within_s)


def test_a_slower_drive_is_slower() -> None:
    found = SweptBench(SweptAxis(Mechanics(0.006, 0.010, 0.0015))).found()
    assert found.total.s == pytest.approx(0.0175, abs=found.total.within_s + 25e-6)


def test_the_mocks_own_physics_are_found_as_a_sine_shows_them() -> None:
    axis = Axis()
    found = SweptBench(SweptAxis(MockMechanics(axis))).found()
    # Each of its two filters is Euler's: a lag of their time constant, and half a step less of delay.
    lag_s = sine_lag_s(MockMechanics(axis), 8.0)
    assert found.total.s == pytest.approx(lag_s, abs=found.total.within_s + 1e-4)
    assert found.total.s == pytest.approx(2 * axis.smoothing_s, abs=5e-4)
    assert found.doubts == []


def test_the_axis_of_the_simulation_is_found_as_a_sine_shows_it() -> None:
    found = SweptBench(SweptAxis(PlantMechanics())).found()
    assert found.total.s == pytest.approx(sine_lag_s(PlantMechanics(), 8.0), abs=found.total.within_s + 2e-4)
    assert found.doubts == []


def sine_lag_s(mechanics: Mechanics, frequency_Hz: float) -> float:
    """Phase of a sine of 3 mm/s on a steady way of 4 mm/s, held for a cycle at a time, as a time; hold taken off."""
    steps = round(CYCLE_NS / mechanics.step_ns)
    swing_mm = 3.0 / (2 * math.pi * frequency_Hz)
    told, went = [], []
    for cycle in range(1000):
        at_s = cycle * 1e-3
        target_mm = HOME_MM + 4.0 * at_s + swing_mm * math.sin(2 * math.pi * frequency_Hz * at_s)
        told.append(target_mm)
        went.append(mechanics.position_mm)
        for _ in range(steps):
            mechanics.advance(target_mm)
    time_s = np.arange(500, 1000) * 1e-3  # whole turns of 8 Hz, after its transients
    turned = np.exp(-2j * math.pi * frequency_Hz * time_s)
    off = [np.array(side[500:]) - HOME_MM - 4.0 * time_s for side in (told, went)]
    ratio = np.sum((off[1] - off[1].mean()) * turned) / np.sum((off[0] - off[0].mean()) * turned)
    return float(-np.angle(ratio) / (2 * math.pi * frequency_Hz)) - 0.5e-3


@pytest.mark.parametrize(
    ("bench", "error", "sentence"),
    [
        (SweptBench(SweptAxis(Mechanics(gain=-1.0))), CheckFailed, r"goes -(0.99|1.00) mm for each millimetre"),
        (
            SweptBench(SweptAxis(Mechanics(gain=0.0))),
            CheckFailed,
            r"goes -?0.00 mm for each millimetre .*\(least 0.5\)",
        ),
        (SweptBench(SweptAxis(shaken_mm=0.02)), CheckFailed, r"coherent to 0.\d\d only \(bound 0.9\)"),
        (SweptBench(stall=20), CheckFailed, r"% of the cycles were missed \(bound 2 %\)"),
        (SweptBench(SweptAxis(frozen_after=300)), DeviceError, r"axis: newest sample is 5\d ms old"),
        (SweptBench(SweptAxis(fault="overcurrent")), DeviceError, "the drive reports: overcurrent"),
    ],
    ids=["wrong sense", "does not move", "shaken", "busy computer", "frozen", "fault"],
)
def test_what_is_wrong_is_refused_with_number_and_bound(
    bench: SweptBench, error: type[RigError], sentence: str
) -> None:
    bench.wiring = Wiring(axis=Epos4Wiring(following_error_mm=20.0))
    with pytest.raises(error, match=sentence):
        bench.found()


def test_a_touch_ends_it_by_the_drives_brake() -> None:
    bench = SweptBench()
    bench.force.touch_N, bench.force.touch_after = 0.6, 700
    with pytest.raises(SafetyStop, match=r"0.6 N on the tip in the sweep \(limit 0.5 N\)"):
        bench.found()
    assert bench.axis.braked


def test_a_stop_ends_it_by_the_drives_brake() -> None:
    bench = SweptBench()
    bench.stopped_after = 900
    with pytest.raises(SafetyStop, match="stopped by a person"):
        bench.found()
    assert bench.axis.braked


def test_a_drive_that_lags_ends_it() -> None:
    bench = SweptBench(SweptAxis(Mechanics(gain=0.0)))
    bench.wiring = Wiring(axis=Epos4Wiring(following_error_mm=0.2))
    with pytest.raises(CheckFailed, match=r"lags its set-point by 0.2\d mm \(limit 0.2 mm\)"):
        bench.found()
    assert bench.axis.braked


def test_a_sweep_keeps_within_speed_and_acceleration() -> None:
    wiring = Wiring(limits=Limits(speed_mm_s=40.0), axis=Epos4Wiring(acceleration_mm_s2=1000.0))
    sweep = sweep_for(wiring, 0.5, 4, 2)
    time_s = np.arange(0.0, sweep.each_s, 1e-3)
    way_mm = np.array([offset_mm(sweep, at_s) for at_s in time_s])
    speed_mm_s = np.gradient(way_mm, 1e-3)
    assert np.abs(speed_mm_s).max() < 0.25 * 40.0
    assert np.abs(np.gradient(speed_mm_s, 1e-3)).max() < 1.05 * 0.9 * 1000.0
    assert way_mm.max() <= sweep.way_mm
    # The tip never turns on its way: no dry friction changes its sign.
    assert speed_mm_s.min() > 0.0
    # A fifth of a millimetre at 2.4 Hz, bounded by speed; five micrometres at 100 Hz, by acceleration.
    assert amplitude_mm(sweep, np.array([2.4, 100.0])) == pytest.approx([2.0 / 15.08, 0.00228], rel=0.01)


def test_a_sweep_ends_where_it_began() -> None:
    sweep = sweep_for(Wiring(), 0.5, 4, 2)
    assert offset_mm(sweep, sweep.duration_s + 0.01) == 0.0
    steps = np.diff([offset_mm(sweep, at_s) for at_s in np.arange(0.0, sweep.duration_s + 0.2, 1e-3)])
    assert np.abs(steps).max() < 0.25 * 60.0 * 1e-3


@pytest.mark.parametrize(
    ("wiring", "sentence"),
    [
        (Wiring(axis=Epos4Wiring(increments_per_mm=40.0)), "show the axis up to 21.4 Hz"),
        (
            Wiring(loop=Loop(rate_Hz=100.0)),
            r"loop.rate_Hz 100, .* show the axis up to 20 Hz .* below axis.bandwidth_Hz 34",
        ),
    ],
)
def test_a_sweep_that_would_show_nothing_is_refused(wiring: Wiring, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        sweep_for(wiring, 0.5, 4, 2)


def test_counts_that_only_the_drive_says_are_looked_at_once_it_has_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forty to the millimetre show it up to 21 Hz, as above."""
    wiring = Wiring(axis=Cia402Wiring())
    assert sweep_for(wiring, 0.5, 4, 2) == sweep_for(Wiring(), 0.5, 4, 2)
    axis = SimpleNamespace(identity=Identity("drive", "1", "", {"increments_per_mm": "40.0"}))
    devices = SimpleNamespace(axis=axis, close=lambda: None)
    monkeypatch.setattr(mock_dynamics, "start_devices", lambda _: devices)
    resting = SimpleNamespace(devices=devices)
    monkeypatch.setattr(calibrate_dynamics, "resting_axis", lambda *_: contextlib.nullcontext(resting))
    for sweep in (partial(mock_dynamics.swept, wiring), partial(axis_dynamics, Operation("sweep"), wiring, 2.0)):
        with pytest.raises(UsageError, match=r"axis.increments_per_mm 40 show the axis up to 21.4 Hz"):
            sweep()


@pytest.mark.parametrize("at_mm", [0.2, 57.0])
def test_a_sweep_that_would_leave_the_workspace_is_refused(at_mm: float) -> None:
    sweep = sweep_for(Wiring(), 0.5, 4, 2)
    refuse_outside(2.0, sweep, Wiring())
    with pytest.raises(UsageError, match=r"sweeps go from .* in the air; \[limits\] have 0 to 60 mm"):
        refuse_outside(at_mm, sweep, Wiring())


def test_the_measured_response_is_the_closed_form_at_each_frequency() -> None:
    bench, sweep = SweptBench(jitter_ns=1), sweep_for(Wiring(), 0.5, 4, 2)
    devices = Devices(cast(ForceSensor, bench.force), cast(ServoAxis, bench.axis), None)
    followed = SweepRun(devices, bench.wiring, sweep, lambda: False, bench.now, bench.sleep).played()
    found = response_of(sweep, followed)
    s = 2j * np.pi * found.frequency_Hz
    exact = np.exp(-s * 0.001525) / ((1 + 0.003 * s) * (1 + 0.005 * s))
    inside = found.frequency_Hz < 60.0
    assert np.abs(found.mean / exact - 1)[inside].max() < 0.05
