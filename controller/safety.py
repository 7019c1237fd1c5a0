"""One priority table: what stops motion, how, and the sentence that says why. First match wins.

IMMEDIATE: the drive stops by its own quick-stop ramp and stays. SOFT: the tip retracts at safe speed, then stays.
Both are latched until acknowledged. Force is counted from the reference zero, so a wrong tare cannot hide a load.
"""
# ruff: noqa: ARG001 - every check has the one signature of the table

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from controller.modes import Mode
from controller.world import World
from rig.config.wiring import Wiring


class Action(IntEnum):
    """What an event does, as the level in the event stream."""

    NOTE = 10
    WARNING = 20
    SOFT = 30
    IMMEDIATE = 40


class Incident(NamedTuple):
    """An event that stops motion."""

    action: Action
    code: str
    text: str


@dataclass(slots=True)
class Watch:
    """What the table looks at besides the world; filled by the loop every tick."""

    mode: Mode = Mode.IDLE
    force_lost: str = ""
    axis_lost: str = ""
    marker_lost: str = ""
    drive_fault: str = ""
    force_valid: bool = True
    force_frozen: bool = False
    force_age_ms: float = 0.0
    axis_age_ms: float = 0.0
    marker_age_ms: float = 0.0
    limb_age_ms: float = 0.0
    wake_latency_ms: float = 0.0
    recorder_fill: float = 0.0
    recorder_silent_s: float = 0.0
    supervisor_lost: bool = False
    operator_silent_s: float = 0.0
    requests: frozenset[str] = frozenset()


Check = Callable[[World, Watch, Wiring], str]

RECORDER_FILL = 0.5
RECORDER_SILENT_S = 3.0
RETRACTING_MARGIN_MM = 1.0
SPEED_MARGIN = 1.2


def _emergency_stop(world: World, watch: Watch, wiring: Wiring) -> str:
    return "emergency stop pressed" if "estop" in watch.requests else ""


def _drive_fault(world: World, watch: Watch, wiring: Wiring) -> str:
    return f"the drive reports: {watch.drive_fault}" if watch.drive_fault else ""


def _axis_lost(world: World, watch: Watch, wiring: Wiring) -> str:
    if watch.axis_lost:
        return f"axis lost: {watch.axis_lost}"
    return _older("axis", watch.axis_age_ms, wiring.loop.stale_axis_ms)


def _following_error(world: World, watch: Watch, wiring: Wiring) -> str:
    limit_mm = wiring.axis.following_error_mm
    if abs(world.following_mm) <= limit_mm:
        return ""
    return f"the axis lags its set-point by {abs(world.following_mm):.2f} mm (limit {limit_mm:g} mm): is it blocked?"


def _standstill(world: World, watch: Watch, wiring: Wiring) -> str:
    limit_mm = wiring.axis.standstill_mm
    if world.standstill_mm <= limit_mm:
        return ""
    return (
        f"the axis goes on reporting {world.position_mm:.3f} mm while its set-point went {world.standstill_mm:.2f} mm "
        f"further (limit {limit_mm:g} mm): its position is frozen, or it is blocked"
    )


def _workspace(world: World, watch: Watch, wiring: Wiring) -> str:
    low_mm = wiring.limits.position_min_mm - RETRACTING_MARGIN_MM
    high_mm = wiring.limits.position_max_mm + RETRACTING_MARGIN_MM
    if low_mm <= world.position_mm <= high_mm:
        return ""
    return f"position {world.position_mm:.2f} mm is outside {low_mm:g} to {high_mm:g} mm"


def _speed(world: World, watch: Watch, wiring: Wiring) -> str:
    limit_mm_s = SPEED_MARGIN * wiring.limits.speed_mm_s
    if abs(world.velocity_mm_s) <= limit_mm_s:
        return ""
    return f"the axis moves at {abs(world.velocity_mm_s):.0f} mm/s (limit {limit_mm_s:g} mm/s)"


def _force_limit(world: World, watch: Watch, wiring: Wiring) -> str:
    force_N = world.raw_N - (0.0 if math.isnan(world.first_zero_N) else world.first_zero_N)
    if force_N <= wiring.force_limit_N:
        return ""
    whose = "the subject's pain threshold" if wiring.force_limit_N < wiring.limits.force_N else "limits.force_N"
    return f"force {force_N:.2f} N is above {whose}, {wiring.force_limit_N:g} N"


def _pain_stop(world: World, watch: Watch, wiring: Wiring) -> str:
    return f"the subject's pain stop at {world.force_N:.2f} N" if "pain" in watch.requests else ""


def _operator_stop(world: World, watch: Watch, wiring: Wiring) -> str:
    return "stopped by the operator" if "stop" in watch.requests else ""


def _force_lost(world: World, watch: Watch, wiring: Wiring) -> str:
    if watch.force_lost:
        return f"force sensor lost: {watch.force_lost}"
    return _older("force", watch.force_age_ms, wiring.stale_force_ms)


def _force_invalid(world: World, watch: Watch, wiring: Wiring) -> str:
    if not watch.force_valid or math.isnan(world.raw_N):
        return "the force sensor marks its samples as invalid or out of range"
    return "the force sensor repeats the same value: it is frozen" if watch.force_frozen else ""


def _force_rate(world: World, watch: Watch, wiring: Wiring) -> str:
    limit = wiring.limits.force_rate_N_s
    if abs(world.force_rate_N_s) <= limit:
        return ""
    return f"force changes by {world.force_rate_N_s:.0f} N/s (limit {limit:g} N/s)"


def _depth(world: World, watch: Watch, wiring: Wiring) -> str:
    limit_mm = wiring.limits.depth_mm
    return f"depth {world.depth_mm:.2f} mm is above {limit_mm:g} mm" if world.depth_mm > limit_mm else ""


def _tracker_lost(world: World, watch: Watch, wiring: Wiring) -> str:
    if wiring.tracker is None:
        return ""
    if watch.marker_lost:
        return f"tracker lost: {watch.marker_lost}"
    limit_ms = wiring.loop.stale_marker_ms
    return _older("tracker", watch.marker_age_ms, limit_ms) or _older("limb's marker", watch.limb_age_ms, limit_ms)


def _patient_moved(world: World, watch: Watch, wiring: Wiring) -> str:
    limit_mm = wiring.limits.patient_mm
    if not world.patient_mm > limit_mm:
        return ""
    return f"the limb moved by {world.patient_mm:.1f} mm against the robot (limit {limit_mm:g} mm)"


def _loop_overrun(world: World, watch: Watch, wiring: Wiring) -> str:
    limit_ms = wiring.loop.overrun_ms
    if watch.wake_latency_ms <= limit_ms:
        return ""
    return f"the loop woke {watch.wake_latency_ms:.0f} ms late (limit {limit_ms:g} ms): is the computer overloaded?"


def _recorder_stalled(world: World, watch: Watch, wiring: Wiring) -> str:
    if watch.recorder_fill <= RECORDER_FILL and watch.recorder_silent_s <= RECORDER_SILENT_S:
        return ""
    return (
        f"the recorder is silent for {watch.recorder_silent_s:.1f} s, its buffer {100 * watch.recorder_fill:.0f} % full"
    )


def _supervisor_lost(world: World, watch: Watch, wiring: Wiring) -> str:
    return "the program that started the loop is gone" if watch.supervisor_lost else ""


def _operator_silent(world: World, watch: Watch, wiring: Wiring) -> str:
    if "unattended" in watch.requests:
        return "whoever started this is not in control any more: the lease was given back or ran out"
    lease_s = wiring.loop.lease_s
    if not lease_s or watch.operator_silent_s <= lease_s:
        return ""
    return f"the operator's program is silent for {watch.operator_silent_s:.1f} s (lease {lease_s:g} s)"


def _older(name: str, age_ms: float, limit_ms: float) -> str:
    return (
        f"{name}: newest sample is {min(age_ms, 1e6):.0f} ms old (limit {limit_ms:g} ms)" if age_ms > limit_ms else ""
    )


TABLE: tuple[tuple[str, Action, Check], ...] = (
    ("emergency_stop", Action.IMMEDIATE, _emergency_stop),
    ("drive_fault", Action.IMMEDIATE, _drive_fault),
    ("axis_lost", Action.IMMEDIATE, _axis_lost),
    ("following_error", Action.IMMEDIATE, _following_error),
    ("axis_frozen", Action.IMMEDIATE, _standstill),
    ("overspeed", Action.IMMEDIATE, _speed),
    ("workspace", Action.IMMEDIATE, _workspace),
    ("force_limit", Action.SOFT, _force_limit),
    ("pain_stop", Action.SOFT, _pain_stop),
    ("operator_stop", Action.SOFT, _operator_stop),
    ("force_lost", Action.SOFT, _force_lost),
    ("force_invalid", Action.SOFT, _force_invalid),
    ("force_rate", Action.SOFT, _force_rate),
    ("depth_limit", Action.SOFT, _depth),
    ("tracker_lost", Action.SOFT, _tracker_lost),
    ("patient_moved", Action.SOFT, _patient_moved),
    ("loop_overrun", Action.SOFT, _loop_overrun),
    ("recorder_stalled", Action.SOFT, _recorder_stalled),
    ("supervisor_lost", Action.SOFT, _supervisor_lost),
    ("operator_silent", Action.SOFT, _operator_silent),
)


def judge(world: World, watch: Watch, wiring: Wiring, least: Action = Action.SOFT) -> Incident | None:
    """The first incident of the table at or above ``least``; None if all is well."""
    for code, action, check in TABLE:
        if action >= least:
            text = check(world, watch, wiring)
            if text:
                return Incident(action, code, text)
    return None
