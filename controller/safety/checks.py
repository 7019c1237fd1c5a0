"""The checks of the safety table: each looks at one thing and says in a sentence what is wrong, "" where nothing is.

Every one takes (state, inputs, wiring). Force is counted from the reference zero, so a wrong tare cannot hide a load.
"""
# ruff: noqa: ARG001 - every check has the one signature of the table

import math

from controller.loop.modes import AT_REST, PRESSING
from controller.loop.state import LoopState
from controller.safety.inputs import SafetyInputs
from rig.config.wiring import Wiring

# 0.4 mm of 8 mm of depth; over 8 mm a tracker's own scale is off by 0.02 at most (0.12 mm rms over its volume).
SCALE_TOLERANCE = 0.05
RECORDER_FILL = 0.5  # 20 s of a loop of 1 kHz are left to retract in before rows are lost
RECORDER_SILENT_S = 3.0  # twenty times the longest sync of a disk that was seen (0.13 s)
# Five of the stop process's longest waits; it has real-time priority where the loop has.
STOP_SILENT_S = 1.0
RETRACTING_MARGIN_MM = 1.0  # twice what the drive's own limits stand outside: these hold first
SPEED_MARGIN = 1.2  # the overshoot of a servo with a damping of 0.46; one tuned well has 0.2 %


def emergency_stop(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """Somebody pressed the emergency stop."""
    return "emergency stop pressed" if "estop" in inputs.requests else ""


def drive_fault(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The drive reports a fault of its own."""
    return f"the drive reports: {inputs.drive_fault}" if inputs.drive_fault else ""


def axis_lost(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The axis does not answer, or its newest sample is too old."""
    if inputs.axis_lost:
        return f"axis lost: {inputs.axis_lost}"
    return _older("axis", inputs.axis_age_ms, wiring.loop.stale_axis_ms)


def following_error(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The axis lags its set-point."""
    limit_mm = wiring.axis.following_error_mm
    if abs(state.following_mm) <= limit_mm:
        return ""
    return f"the axis lags its set-point by {abs(state.following_mm):.2f} mm (limit {limit_mm:g} mm): is it blocked?"


def axis_frozen(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The axis reports one place while its set-point goes on."""
    limit_mm = wiring.axis.standstill_mm
    if state.standstill_mm <= limit_mm:
        return ""
    return (
        f"the axis goes on reporting {state.position_mm:.3f} mm while its set-point went {state.standstill_mm:.2f} mm "
        f"further (limit {limit_mm:g} mm): its position is frozen, or it is blocked"
    )


def workspace(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The axis is outside the workspace."""
    low_mm = wiring.limits.position_min_mm - RETRACTING_MARGIN_MM
    high_mm = wiring.limits.position_max_mm + RETRACTING_MARGIN_MM
    if low_mm <= state.position_mm <= high_mm:
        return ""
    return f"position {state.position_mm:.2f} mm is outside {low_mm:g} to {high_mm:g} mm"


def overspeed(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The axis is faster than it may be."""
    limit_mm_s = SPEED_MARGIN * wiring.limits.speed_mm_s
    if abs(state.velocity_mm_s) <= limit_mm_s:
        return ""
    return f"the axis moves at {abs(state.velocity_mm_s):.0f} mm/s (limit {limit_mm_s:g} mm/s)"


def force_limit(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """Load, or the load that will be there before the axis stands, above machine limit or pain threshold."""
    if _unfelt(state, inputs, wiring) or _unzeroed(state, inputs, wiring):
        return ""
    load_N, predicted_N, limit_N = state.load.force_N, state.load.predicted_N, wiring.force_limit_N
    if load_N <= limit_N and predicted_N <= limit_N:
        return ""
    whose = "the subject's pain threshold" if limit_N < wiring.limits.force_N else "limits.force_N"
    if not load_N <= limit_N:
        return f"force {load_N:.2f} N is above {whose}, {limit_N:g} N"
    return f"force {load_N:.2f} N would be {predicted_N:.2f} N before the axis stands, above {whose}, {limit_N:g} N"


def torque_limit(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """Moment above its limit."""
    if _unfelt(state, inputs, wiring) or _unzeroed(state, inputs, wiring):
        return ""
    torque_N_m, limit_N_m = state.load.torque_N_m, wiring.limits.torque_N_m
    if torque_N_m <= limit_N_m:
        return ""
    return f"torque {torque_N_m:.3f} N m is above limits.torque_N_m, {limit_N_m:g} N m"


def pushed(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The load rises while the tip rests: the limb pushes."""
    more_N, limit_N = state.load.force_N - state.rest_N, wiring.limits.pushed_N
    if inputs.mode not in AT_REST or _unfelt(state, inputs, wiring) or not more_N > limit_N:
        return ""
    return f"the limb pushes: {more_N:.2f} N more than when the tip came to rest (limits.pushed_N {limit_N:g} N)"


def pain_stop(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The subject's stop."""
    return f"the subject's pain stop at {state.force_N:.2f} N" if "pain" in inputs.requests else ""


def operator_stop(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The operator's stop, also for want of the keypad that must be there."""
    if "keypad" in inputs.requests:
        return "the keypad or foot switch for stops is gone: plug it in, then acknowledge the stop"
    return "stopped by the operator" if "stop" in inputs.requests else ""


def force_lost(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The force sensor does not answer, or its newest sample is too old."""
    if inputs.force_lost:
        return f"force sensor lost: {inputs.force_lost}"
    return _older("force", inputs.force_age_ms, wiring.stale_force_ms)


def force_invalid(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The sensor does not vouch for its samples, or repeats one."""
    if not inputs.force_valid or not all(map(math.isfinite, state.wrench)):
        return "the force sensor marks its samples as invalid or out of range"
    return "the force sensor repeats the same value: it is frozen" if inputs.force_frozen else ""


def force_rate(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """Force changes faster than it may."""
    if _unfelt(state, inputs, wiring):
        return ""
    rate_N_s, limit_N_s = state.load.rate_N_s, wiring.limits.force_rate_N_s
    return "" if rate_N_s <= limit_N_s else f"force changes by {rate_N_s:.0f} N/s (limit {limit_N_s:g} N/s)"


def first_touch(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The sensor does not answer a touch as it was calibrated."""
    return inputs.touch_wrong


def contact_lost(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """What the tip presses on is not felt any more, though the tip did not leave."""
    vanished_N = state.load.vanished_N
    if not vanished_N > 0.0 or inputs.mode not in PRESSING:
        return inputs.contact_lost
    return (
        f"{vanished_N:.2f} N vanished at once though the tip did not leave: the limb is gone, or a force channel died"
        " or lost its gain; check sensor and cable, then `rig calibrate force`"
    )


def oscillation(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The force loop swings by itself."""
    return inputs.oscillation


def axis_scale(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The tracker sees the tip go another way than the axis says, beyond tolerance and chance."""
    seen = state.axis_scale
    if seen is None or (seen.high >= 1.0 - SCALE_TOLERANCE and seen.low <= 1.0 + SCALE_TOLERANCE):
        return ""
    return (
        f"the tracker sees {seen.low:.3f} to {seen.high:.3f} mm for each mm of the axis (1 within"
        f" {SCALE_TOLERANCE:g}): check axis.increments_per_mm, then `rig calibrate axis`"
    )


def depth_limit(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The tip is deeper than it may be."""
    limit_mm = wiring.limits.depth_mm
    return f"depth {state.depth_mm:.2f} mm is above {limit_mm:g} mm" if state.depth_mm > limit_mm else ""


def tracker_lost(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The tracker does not answer, or the limb's marker is gone."""
    if wiring.tracker is None:
        return ""
    if inputs.marker_lost:
        return f"tracker lost: {inputs.marker_lost}"
    limit_ms = wiring.loop.stale_marker_ms
    return _older("tracker", inputs.marker_age_ms, limit_ms) or _older("limb's marker", inputs.limb_age_ms, limit_ms)


def patient_moved(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The limb moved against the robot."""
    limit_mm = wiring.limits.patient_mm
    if not state.patient_mm > limit_mm:
        return ""
    return f"the limb moved by {state.patient_mm:.1f} mm against the robot (limit {limit_mm:g} mm)"


def loop_overrun(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """A cycle began late, or the one before was held up."""
    limit_ms = wiring.loop.overrun_ms
    if inputs.late_ms <= limit_ms:
        return ""
    return f"the loop came {inputs.late_ms:.0f} ms late (limit {limit_ms:g} ms): is the computer overloaded?"


def recorder_stalled(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """Nobody takes the rows that are to be recorded, or they reach no file."""
    if "recording" in inputs.requests:
        return "the recording failed, and nothing moves unrecorded: the trial says why"
    silent_s, full = inputs.recorder_silent_s, 100 * inputs.recorder_fill
    if inputs.recorder_fill <= RECORDER_FILL and silent_s <= RECORDER_SILENT_S:
        return ""
    return f"the recorder is silent for {silent_s:.1f} s, its buffer {full:.0f} % full"


def stop_lost(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The stop process is frozen or dead: a press would not be heard."""
    if inputs.stop_silent_s <= STOP_SILENT_S:
        return ""
    return (
        f"the stop process is silent for {inputs.stop_silent_s:.1f} s (limit {STOP_SILENT_S:g} s), so nobody could stop"
        " what moves: start the bench again"
    )


def input_lost(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """An input is gone without which nothing is to move."""
    return inputs.input_lost


def supervisor_lost(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """The program that started the loop is gone."""
    return "the program that started the loop is gone" if inputs.supervisor_lost else ""


def operator_silent(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> str:
    """Nobody is in control."""
    if "unattended" in inputs.requests:
        return "whoever started this is not in control any more: control was given back or ran out"
    lease_s = wiring.loop.lease_s
    if not lease_s or inputs.operator_silent_s <= lease_s:
        return ""
    return f"the operator's program is silent for {inputs.operator_silent_s:.1f} s (lease {lease_s:g} s)"


def _unfelt(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> bool:
    """At rest the axis gives way to what is felt now, not to what a lost or invalid sensor said last."""
    if inputs.mode not in AT_REST:
        return False
    fresh = not inputs.force_lost and inputs.force_valid and inputs.force_age_ms <= wiring.stale_force_ms
    return not fresh or not all(map(math.isfinite, state.load))


def _unzeroed(state: LoopState, inputs: SafetyInputs, wiring: Wiring) -> bool:
    """At rest, with neither zero nor calibration, only a change says something: unloaded, a sensor may show 20 N."""
    return inputs.mode in AT_REST and state.reference_zero is None and wiring.calibration.of_force is None


def _older(name: str, age_ms: float, limit_ms: float) -> str:
    return (
        f"{name}: newest sample is {min(age_ms, 1e6):.0f} ms old (limit {limit_ms:g} ms)" if age_ms > limit_ms else ""
    )
