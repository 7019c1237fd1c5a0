"""Scale and sense of the axis from places that a tracker or a gauge block gives, and what is refused."""

import threading
import time
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from controller.commissioning.axis import (
    Place,
    against_block,
    against_tracker,
    ahead_mm,
    known_direction,
    refuse_first_step,
)
from controller.commissioning.axis_moves import RestingAxis, drive_to_positions, steps_mm, touches_mm
from controller.devices.drivers import Devices
from drivers.roles import Identity
from rig.channels import AxisSample, ForceSample, MarkerSample
from rig.config.calibration import AxisCalibration
from rig.config.products.cia402 import Cia402Wiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.errors import CheckFailed, DeviceError, SafetyStop

NOW = datetime(2026, 3, 1, 9, 0, tzinfo=UTC)
DRIVE = Identity("EPOS4", "A1", "0x0170")
WAY = np.array([0.12, 0.25, -0.9608]) / np.linalg.norm([0.12, 0.25, -0.9608])
TIP_MM, ARM_MM = np.array([35.0, -60.0, -1400.0]), np.array([95.0, -40.0, -1405.0]) + 20.0 * WAY


def place(axis_mm: float, scale: float = 1.0, arm_mm: np.ndarray | None = ARM_MM, seed: int = 1) -> Place:
    """30 frames at rest, noise of 0.06 mm, the marker ``scale`` times as far as the axis says."""
    noise = np.random.default_rng(seed + round(100 * axis_mm)).normal(0.0, 0.06, (30, 3))
    arms = np.zeros((0, 3)) if arm_mm is None else np.tile(arm_mm, (30, 1))
    return Place(axis_mm, TIP_MM + scale * axis_mm * WAY + noise, arms)


def places(scale: float = 1.0) -> list[Place]:
    return [place(axis_mm, scale) for axis_mm in steps_mm(2.0, 14.0, 4)]


def calibrated(scale: float) -> AxisCalibration:
    return against_tracker(DRIVE, Epos4Wiring(), places(scale), "limb marker", NOW)


def test_places_go_up_in_even_steps_and_down_again() -> None:
    assert steps_mm(2.0, 14.0, 4) == [2.0, 5.0, 8.0, 11.0, 14.0, 11.0, 8.0, 5.0, 2.0]


@pytest.mark.parametrize("scale", [0.995, 1.0, 1.005])
def test_the_scale_is_what_the_tracker_saw_of_a_millimetre(scale: float) -> None:
    found = calibrated(scale)
    # 270 frames of 0.06 mm over places with a root sum of squares of 66 mm: 0.0009.
    assert found.uncertainty == pytest.approx(0.06 / (np.std(steps_mm(2, 14, 4)) * 270**0.5), rel=0.3)
    assert found.scale == pytest.approx(scale, abs=3 * found.uncertainty)
    assert (found.serial, found.direction, found.increments_per_mm) == ("A1", 1, 2000.0)
    assert found.steps[4].axis_mm == 12.0
    assert found.steps[4].reference_mm == pytest.approx(12.0 * scale, abs=0.05)


def test_a_scale_that_only_the_drive_says_is_what_was_calibrated_with() -> None:
    drive = replace(DRIVE, settings={"increments_per_mm": "1024.5"})
    for config, per_mm in ((Cia402Wiring(), 1024.5), (Cia402Wiring(increments_per_mm=1024.0), 1024.0)):
        assert against_tracker(drive, config, places(1.0), "limb marker", NOW).increments_per_mm == per_mm


@pytest.mark.parametrize("scale", [0.98, 1.02])
def test_a_scale_off_by_two_per_cent_is_refused(scale: float) -> None:
    with pytest.raises(CheckFailed, match=r"a millimetre of the axis is (0.9[78]|1.0[12]).* limit 1 \+- 0.01"):
        calibrated(scale)


@pytest.mark.parametrize("scale", [0.5, 2.0, 0.0])
def test_half_or_twice_the_way_is_refused_with_the_first_step(scale: float) -> None:
    with pytest.raises(CheckFailed, match=r"the axis says it went 3 mm and the tracker saw"):
        refuse_first_step(place(2.0, scale), place(5.0, scale))
    refuse_first_step(place(2.0), place(5.0))


def test_a_limb_marker_ahead_says_the_sense_one_behind_refuses_it_and_one_beside_says_nothing() -> None:
    # Along the way, the marker lies 37.0 mm ahead of a tip at 0: (60, 20, -5) + 20 way, times way.
    ahead = ahead_mm(places())
    assert ahead == pytest.approx((ARM_MM - TIP_MM) @ WAY - 2.0, abs=0.2)
    assert known_direction(ahead) == "limb marker"
    behind = ahead_mm([place(axis_mm, -1.0) for axis_mm in (2.0, 5.0, 8.0)])
    with pytest.raises(CheckFailed, match=r"goes away from the limb's marker, .* axis.direction is wrong"):
        known_direction(behind)
    beside = ARM_MM - ((ARM_MM - TIP_MM) @ WAY - 5.0) * WAY
    assert known_direction(ahead_mm([place(x, arm_mm=beside) for x in (2.0, 5.0)])) is None
    assert ahead_mm([place(x, arm_mm=None) for x in (2.0, 5.0)]) is None


def test_a_gauge_block_gives_the_scale_of_two_contacts() -> None:
    found = against_block(DRIVE, Epos4Wiring(), [19.51, 19.50, 19.49], [9.52, 9.50, 9.48], 10.0, NOW)
    assert found.scale == pytest.approx(1.0)
    assert found.uncertainty == pytest.approx(np.hypot(0.01, 0.02) / 3**0.5 / 10.0)
    assert (found.reference, found.direction_known_by) == ("gauge block", "contact")


@pytest.mark.parametrize(
    ("table", "block", "sentence"),
    [
        ([19.5] * 3, [14.5] * 3, "a millimetre of the axis is 2.0000 mm of the gauge block"),
        ([19.5] * 3, [9.3] * 3, "a millimetre of the axis is 0.9804 mm"),
        ([19.5] * 3, [19.5] * 3, "was the block under the tip"),
        ([19.3, 19.5, 19.7], [9.3, 9.5, 9.7], "where the interval is wide"),
    ],
)
def test_contacts_that_do_not_give_the_block_are_refused(table: list[float], block: list[float], sentence: str) -> None:
    with pytest.raises(CheckFailed, match=sentence):
        against_block(DRIVE, Epos4Wiring(), table, block, 10.0, NOW)


# The moves, on devices that are there at once


class Bench:
    """Axis, force sensor and tracker of one clock; the tip meets a wall of 100 N/mm at ``wall_mm``."""

    def __init__(self, wall_mm: float = 100.0, scale: float = 1.0) -> None:
        self.now_ns, self.position_mm = 10**9, 0.0
        self.wall_mm, self.scale, self.visited = wall_mm, scale, [0.0]
        self.tip_seen, self.polls = True, 0
        self.stall_s, self.silent = 0.0, False

    def clock(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        self.now_ns += round((seconds + self.stall_s) * 1e9)

    def move_to(self, position_mm: float, speed_mm_s: float) -> None:
        self.position_mm = position_mm
        self.visited.append(position_mm)

    def request(self, now_ns: int) -> None:
        """Answered by the next poll."""

    @property
    def load_N(self) -> float:
        return 100.0 * max(self.position_mm * self.scale - self.wall_mm, 0.0)


class AxisOf(Bench):
    def poll(self, now_ns: int) -> list[AxisSample]:
        self.polls += 1
        return [AxisSample(0, now_ns, now_ns, self.position_mm, 0.0, 0.0, 0, 1)]


class ForceOf:
    def __init__(self, bench: Bench) -> None:
        self.bench = bench

    def poll(self, now_ns: int) -> list[ForceSample]:
        if self.bench.silent:
            return []
        return [ForceSample(0, now_ns, now_ns, 0, 0.2, -0.1, 0.8 - self.bench.load_N, 0.0, 0.0, 0.0, 25.0, 0, 1)]


class TrackerOf:
    def __init__(self, bench: Bench) -> None:
        self.bench = bench

    def poll(self, now_ns: int) -> list[MarkerSample]:
        tip = TIP_MM + self.bench.scale * self.bench.position_mm * WAY
        return [_seen(now_ns, 0, tip, self.bench.tip_seen), _seen(now_ns, 1, ARM_MM, True)]


def _seen(now_ns: int, tool: int, at_mm: np.ndarray, valid: bool) -> MarkerSample:
    x_mm, y_mm, z_mm = (float(part) for part in at_mm)
    return MarkerSample(0, now_ns, now_ns, 0, tool, x_mm, y_mm, z_mm, 1.0, 0.0, 0.0, 0.0, 0.1, int(valid))


def resting(bench: AxisOf) -> RestingAxis:
    devices = Devices(ForceOf(bench), bench, TrackerOf(bench))  # type: ignore[arg-type]
    return RestingAxis(devices, now=bench.clock, sleep=bench.sleep)


def test_the_axis_is_read_at_each_place() -> None:
    found = drive_to_positions(resting(AxisOf()), steps_mm(2.0, 14.0, 4))
    assert [one.axis_mm for one in found] == pytest.approx([0.0, *steps_mm(2.0, 14.0, 4)])
    assert against_tracker(DRIVE, Epos4Wiring(), found, "limb marker", NOW).scale == pytest.approx(1.0)


def test_a_wrong_scale_goes_no_farther_than_the_first_step() -> None:
    bench = AxisOf(scale=2.0)
    with pytest.raises(CheckFailed, match="the tracker saw 4 mm"):
        drive_to_positions(resting(bench), steps_mm(2.0, 14.0, 4))
    assert max(bench.visited) == 2.0


def test_the_wrong_way_goes_no_farther_than_the_first_step() -> None:
    bench = AxisOf(scale=-1.0)
    with pytest.raises(CheckFailed, match=r"goes away from the limb's marker, .* axis.direction is wrong"):
        drive_to_positions(resting(bench), steps_mm(2.0, 14.0, 4))
    assert max(bench.visited) == 2.0


def test_a_first_step_too_short_to_tell_is_not_judged() -> None:
    bench = AxisOf(scale=2.0)
    with pytest.raises(CheckFailed, match=r"the axis says it went 3.5 mm and the tracker saw 7 mm"):
        drive_to_positions(resting(bench), steps_mm(0.5, 12.5, 4))


def test_something_in_the_way_ends_it() -> None:
    bench = AxisOf(wall_mm=7.9)
    with pytest.raises(SafetyStop, match=r"10 N on the tip at 8.00 mm \(limit 0.5 N\): something is in its way"):
        drive_to_positions(resting(bench), steps_mm(2.0, 14.0, 4))
    assert max(bench.visited) == 8.0


def test_a_tip_that_is_not_seen_ends_it() -> None:
    bench = AxisOf()
    bench.tip_seen = False
    with pytest.raises(CheckFailed, match=r"the tip's marker is not seen at 0.00 mm"):
        drive_to_positions(resting(bench), steps_mm(2.0, 14.0, 4))


def test_a_touch_is_where_the_load_passes_its_threshold_and_presses_no_farther_than_a_step() -> None:
    bench = AxisOf(wall_mm=19.98)
    axis = resting(bench)
    axis.place()
    # 0.3 N of 100 N/mm are 3 um into the wall, interpolated over a step of 50 um that ends 20 um in.
    assert touches_mm(axis, 19.5) == pytest.approx([19.98 - 0.03 + 0.05 * 0.3 / 2.0] * 3, abs=0.002)
    assert max(bench.visited) == pytest.approx(20.0)
    assert bench.position_mm == 18.5


def test_a_search_that_begins_in_contact_or_meets_nothing_is_refused() -> None:
    bench = AxisOf(wall_mm=19.0)
    axis = resting(bench)
    axis.place()
    with pytest.raises(CheckFailed, match=r"on the tip at 19.50 mm already: begin farther out"):
        touches_mm(axis, 19.5)
    with pytest.raises(CheckFailed, match=r"no contact from 5 to 10 mm.* axis.direction"):
        touches_mm(axis, 5.0)


def test_a_computer_that_stalls_still_reads_and_a_sensor_that_is_silent_ends_it() -> None:
    bench = AxisOf()
    bench.stall_s = 0.6
    assert resting(bench).place().axis_mm == 0.0
    bench.silent = True
    with pytest.raises(DeviceError, match=r"\d+ samples of the axis and 0 of force came in 0.8 s"):
        resting(bench).place()


class RingingTracker(TrackerOf):
    """Its frames, one in 16 ms, wait to be fetched; for 0.2 s after a move the tip still swings by 1 mm."""

    def __init__(self, bench: "HeldUp") -> None:
        super().__init__(bench)
        self.held_up, self._taken_ns = bench, bench.now_ns

    def poll(self, now_ns: int) -> list[MarkerSample]:
        taken = range(self._taken_ns, now_ns, 16_000_000)
        self._taken_ns = taken[-1] + 16_000_000 if taken else self._taken_ns
        swung_mm = {at_ns: float(at_ns - self.held_up.moved_ns < 200_000_000) for at_ns in taken}
        return [_seen(at_ns, 0, TIP_MM + (self.held_up.position_mm + swung_mm[at_ns]) * WAY, True) for at_ns in taken]


class HeldUp(AxisOf):
    """A computer that sleeps through the rest after a move."""

    moved_ns = 0

    def move_to(self, position_mm: float, speed_mm_s: float) -> None:
        super().move_to(position_mm, speed_mm_s)
        self.moved_ns, self.stall_s = self.now_ns, 0.3

    def sleep(self, seconds: float) -> None:
        super().sleep(seconds)
        self.stall_s = 0.0


def test_a_computer_held_up_while_the_axis_rests_reads_nothing_of_before() -> None:
    bench = HeldUp()
    devices = Devices(ForceOf(bench), bench, RingingTracker(bench))  # type: ignore[arg-type]
    axis = RestingAxis(devices, now=bench.clock, sleep=bench.sleep)
    axis.go(5.0)
    tip_mm = axis.place().tip_mm
    assert len(tip_mm) > 20
    assert tip_mm == pytest.approx(np.tile(TIP_MM + 5.0 * WAY, (len(tip_mm), 1)))


def test_while_a_person_is_waited_for_the_axis_is_kept_alive() -> None:
    bench = AxisOf()
    axis, before = resting(bench), bench.polls

    def takes_its_time() -> None:
        while bench.polls < before + 50:
            time.sleep(0.001)

    axis.wait_for(takes_its_time)
    assert bench.polls >= before + 50

    def fails() -> None:
        raise CheckFailed("nobody there")

    with pytest.raises(CheckFailed, match="nobody there"):
        axis.wait_for(fails)
    assert axis.wait_for(lambda: 4.0) == 4.0


def test_a_stop_ends_a_question_that_nobody_answers() -> None:
    bench, never = AxisOf(), threading.Event()

    def stopped() -> None:
        if bench.polls > 50:
            raise SafetyStop("stopped by a person")

    devices = Devices(ForceOf(bench), bench, TrackerOf(bench))  # type: ignore[arg-type]
    axis = RestingAxis(devices, refuse_stopped=stopped, now=bench.clock, sleep=bench.sleep)
    with pytest.raises(SafetyStop, match="stopped by a person"):
        axis.wait_for(never.wait)
    never.set()
