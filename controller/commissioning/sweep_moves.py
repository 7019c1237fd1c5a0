"""Plays a sweep on the axis, cycle by cycle as the loop would, and looks at every cycle whether it may go on.

No loop runs meanwhile. A load on the tip, a stop, a drive that lags or falls silent ends it by the drive's own brake.
"""

import math
import time
from collections.abc import Callable

import numpy as np

from controller.commissioning.axis_dynamics import SweepRecord
from controller.commissioning.axis_moves import LARGEST_TOUCH_N, RestingAxis
from controller.commissioning.sweep import LARGEST_SWING_MM, AirSweep, offset_mm
from controller.devices.drivers import Devices
from controller.loop.executive import Cycle, Executive, sleep_until
from controller.loop.phase_lock import PhaseLock
from drivers.epos4.walker import never
from rig.channels import AxisSample, ForceSample
from rig.config.wiring import Wiring
from rig.errors import CheckFailed, DeviceError, SafetyStop, UsageError

# Five millimetres of the softest limb (0.12 N/mm at contact) press with 1.8 N, and 0.5 N end it.
CLEAR_MM = 5.0
# What the drive rests before it is told anything, and listens for after the last set-point: ten lags of 10 ms.
LISTEN_S = 0.1
# Between two looks for a force sample: a twentieth of a cycle of 1 kHz, which is what its age may be wrong by.
LOOK_NS = 50_000


def refuse_outside(at_mm: float, sweep: AirSweep, wiring: Wiring) -> None:
    """Raises UsageError, before anything is opened, where a sweep from ``at_mm`` on would leave the workspace."""
    low_mm, high_mm = wiring.limits.position_min_mm, wiring.limits.position_max_mm
    to_mm = at_mm + sweep.way_mm + CLEAR_MM
    if not low_mm + LARGEST_SWING_MM <= at_mm or to_mm > high_mm:
        raise UsageError(
            f"--from-mm {at_mm:g}: sweeps go from {at_mm - LARGEST_SWING_MM:g} to {to_mm:.1f} mm, the last"
            f" {CLEAR_MM:g} mm to see that they are in the air; [limits] have {low_mm:g} to {high_mm:g} mm"
        )


def refuse_touching(axis: RestingAxis, at_mm: float, sweep: AirSweep) -> None:
    """Goes through all that must be air, and back to ``at_mm``; raises SafetyStop where something presses."""
    for position_mm in (at_mm, at_mm + sweep.way_mm, at_mm + sweep.way_mm + CLEAR_MM, at_mm):
        axis.go(position_mm)
        axis.place()


class SweepRun:
    """One sweep on an axis that is enabled and stands; ``played`` returns what was told and what came."""

    def __init__(
        self,
        devices: Devices,
        wiring: Wiring,
        sweep: AirSweep,
        interrupted: Callable[[], bool] = never,
        now: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[int], None] = sleep_until,
    ) -> None:
        self._devices, self._wiring, self._sweep = devices, wiring, sweep
        self._interrupted, self._now, self._sleep = interrupted, now, sleep
        self._told: list[tuple[int, float, float]] = []
        self._axis: list[AxisSample] = []
        self._force: ForceSample | None = None
        self._unloaded: ForceSample | None = None
        self._begin_ns = self._missed = 0
        self._phase = PhaseLock(round(1e9 / wiring.loop.rate_Hz), devices.force.period_ns)

    def played(self) -> SweepRecord:
        """Raises SafetyStop, CheckFailed or DeviceError where it was ended; the axis stands then, braked."""
        try:
            Executive(self._now, self._sleep, self._sleep, self._rest).run(self, self._phase)
        except BaseException:
            self._devices.axis.quick_stop()
            raise
        return self._followed()

    def catch_up(self, now_ns: int) -> None:
        """Takes what the axis has sent, straight after a cycle and before the next."""
        self._axis += self._devices.axis.poll(now_ns)

    prepare = catch_up

    def take_force(self, now_ns: int) -> None:
        """Takes samples of the force sensor, and shows them to the phase lock."""
        for sample in self._devices.force.poll(now_ns):
            self._phase.observe(sample.capture_ns, sample.arrival_ns)
            self._force = sample if sample.valid else self._force

    def _rest(self, until_ns: int) -> None:
        self._sleep(min(until_ns, self._now() + LOOK_NS))

    def run_cycle(self, cycle: Cycle) -> bool:
        """The turn itself; False where it is the last."""
        now_ns = cycle.began_ns
        ready = self._force is not None and bool(self._axis)
        if not self._begin_ns:
            self._begin_ns = cycle.scheduled_ns + round(LISTEN_S * 1e9)
        elapsed_s = (cycle.scheduled_ns - self._begin_ns) * 1e-9
        if elapsed_s < 0 or not ready:
            self._refuse_silent(elapsed_s)
            self._devices.axis.request(now_ns)
            return True
        self._unloaded = self._unloaded or self._force
        self._refuse_cycle(cycle)
        self._command(now_ns, offset_mm(self._sweep, elapsed_s))
        self._missed = cycle.missed
        return elapsed_s < self._sweep.duration_s + LISTEN_S

    def _command(self, now_ns: int, offset: float) -> None:
        assert self._force
        if not self._told:
            self._home_mm = self._axis[-1].position_mm
        target_mm = self._home_mm + offset
        self._told.append((now_ns, target_mm, (now_ns - self._force.capture_ns) * 1e-9))
        self._devices.axis.command(target_mm, now_ns)

    def _refuse_silent(self, elapsed_s: float) -> None:
        if elapsed_s > self._wiring.loop.stale_axis_ms * 1e-3:
            raise DeviceError("no sample of axis or force came before the sweep; run `rig doctor`")

    def _refuse_cycle(self, cycle: Cycle) -> None:
        """Raises where a look says that it must not go on."""
        wiring, now_ns = self._wiring, cycle.wake_ns
        assert self._force and self._unloaded
        if self._interrupted():
            raise SafetyStop("stopped by a person: the axis was braked in its sweep")
        if self._devices.axis.fault:
            raise DeviceError(f"the drive reports: {self._devices.axis.fault}")
        load_N = math.dist(self._force[4:7], self._unloaded[4:7])
        if load_N > LARGEST_TOUCH_N:
            raise SafetyStop(
                f"{load_N:.2g} N on the tip in the sweep (limit {LARGEST_TOUCH_N:g} N): it is not in the air"
            )
        behind_mm = abs(self._told[-1][1] - self._axis[-1].position_mm) if self._told else 0.0
        if behind_mm > wiring.axis.following_error_mm:
            raise CheckFailed(
                f"the axis lags its set-point by {behind_mm:.2f} mm (limit {wiring.axis.following_error_mm:g} mm) in a"
                " sweep that its limits allow: is it blocked, or axis.direction wrong?"
            )
        for whose, capture_ns, limit_ms in (
            ("force", self._force.capture_ns, wiring.stale_force_ms),
            ("axis", self._axis[-1].capture_ns, wiring.loop.stale_axis_ms),
        ):
            age_ms = (now_ns - capture_ns) * 1e-6
            if age_ms > limit_ms:
                raise DeviceError(f"{whose}: newest sample is {age_ms:.0f} ms old in the sweep (limit {limit_ms:g} ms)")

    def _followed(self) -> SweepRecord:
        told = np.array(self._told)
        axis = np.array([(one.capture_ns, one.position_mm, one.current_A) for one in self._axis if one.valid])
        return SweepRecord(
            told_s=(told[:, 0] - self._begin_ns) * 1e-9,
            told_mm=told[:, 1] - self._home_mm,
            force_age_s=told[:, 2],
            position_s=(axis[:, 0] - self._begin_ns) * 1e-9,
            position_mm=axis[:, 1] - self._home_mm,
            current_A=axis[:, 2],
            missed=self._missed,
        )
