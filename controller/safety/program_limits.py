"""A program against the limits, before anything moves: every refusal names the number that is wrong and its bound."""

import math
from itertools import pairwise

import numpy as np

from controller.loop.steps import Approach, Compress, Dither, Hold, MoveTo, Program, Retract, Step, TrackForce, Zero
from rig.config.wiring import Wiring
from rig.errors import UsageError

LONGEST_S = 3600.0  # nobody holds a limb still for longer; more is a slip of the unit


def refuse_beyond_limits(program: Program, wiring: Wiring) -> None:
    """Raises UsageError with every way in which ``program`` goes beyond ``wiring``'s limits."""
    wrong = [reason for step in program.steps for reason in _reasons(step, wiring)]
    wrong += [
        f"a {later.step} step needs the surface, but no approach comes before it"
        for earlier, later in _needing_surface(program)
        if not any(isinstance(step, Approach) for step in earlier)
    ]
    only_leaving = all(isinstance(step, Retract | Hold) for step in program.steps)
    if not only_leaving and not isinstance(program.steps[0], Zero):
        wrong.append("the first step must be a zero: without a reference zero no force limit holds")
    if wrong:
        raise UsageError(f"{program.name} refused before moving: " + "; ".join(dict.fromkeys(wrong)))


def _needing_surface(program: Program) -> list[tuple[tuple[Step, ...], Step]]:
    return [
        (program.steps[:at], step) for at, step in enumerate(program.steps) if isinstance(step, Compress | TrackForce)
    ]


def _reasons(step: Step, wiring: Wiring) -> list[str]:
    limits, force_N = wiring.limits, wiring.force_limit_N
    match step:
        case MoveTo():
            return [*_speed(step.speed_mm_s, wiring), *_position("position", step.position_mm, wiring)]
        case Approach():
            reasons = [*_speed(step.speed_mm_s, wiring), *_position("search_to_mm", step.search_to_mm, wiring)]
            reasons += _touches(step, wiring) if step.touches else []
            return reasons + _above("contact_force_N", step.contact_force_N, force_N, "N", "the force limit")
        case Compress():
            reasons = [
                *_speed(step.speed_mm_s, wiring),
                *_above("depth", step.depth_mm, limits.depth_mm, "mm", "limits.depth_mm"),
            ]
            return reasons + _above("force_limit_N", step.force_limit_N, force_N, "N", "the force limit")
        case Dither():
            peak_mm_s = 2 * math.pi * step.frequency_Hz * step.amplitude_mm
            return _above("speed of the dither", peak_mm_s, limits.speed_mm_s, "mm/s", "limits.speed_mm_s")
        case TrackForce():
            reasons = [*_speed(step.speed_limit_mm_s, wiring), *_reference(step)]
            reasons += _above("reference force", max(step.forces_N), force_N, "N", "the force limit")
            depth_mm = _depth_mm(step)
            return reasons + _above("depth of it by the model", depth_mm, limits.depth_mm, "mm", "limits.depth_mm")
        case Retract():
            return [
                *_speed(step.speed_mm_s, wiring),
                *_above(
                    "retract speed", step.speed_mm_s, limits.retract_speed_mm_s, "mm/s", "limits.retract_speed_mm_s"
                ),
            ]
        case _:
            return []


def _touches(step: Approach, wiring: Wiring) -> list[str]:
    limits = wiring.limits
    return [
        *_above("touch speed", step.touch_speed_mm_s, limits.speed_mm_s, "mm/s", "limits.speed_mm_s"),
        *_above("back-off speed", step.back_off_mm_s, limits.retract_speed_mm_s, "mm/s", "limits.retract_speed_mm_s"),
    ]


def _reference(step: TrackForce) -> list[str]:
    reasons = []
    if len(step.times_s) != len(step.forces_N):
        reasons.append(f"the reference has {len(step.times_s)} times but {len(step.forces_N)} forces")
    if any(later < earlier for earlier, later in pairwise(step.times_s)):
        reasons.append("the reference's times go backwards")
    reached_N, lasts_s = step.gains[-1].force_N, step.repeats * step.times_s[-1]
    reasons += _above("duration of the reference", lasts_s, LONGEST_S, "s", "an hour")
    return reasons + _above("reference force", max(step.forces_N), reached_N, "N", "the largest force of the model")


def _depth_mm(step: TrackForce) -> float:
    """Where the model has the largest force of the reference."""
    forces_N, depths_mm = [row.force_N for row in step.gains], [row.depth_mm for row in step.gains]
    return float(np.interp(max(step.forces_N), forces_N, depths_mm))


def _speed(speed_mm_s: float, wiring: Wiring) -> list[str]:
    return _above("speed", speed_mm_s, wiring.limits.speed_mm_s, "mm/s", "limits.speed_mm_s")


def _position(name: str, position_mm: float, wiring: Wiring) -> list[str]:
    low, high = wiring.limits.position_min_mm, wiring.limits.position_max_mm
    return [] if low <= position_mm <= high else [f"{name} {position_mm:g} mm is outside {low:g} to {high:g} mm"]


def _above(name: str, value: float, limit: float, unit: str, whose: str) -> list[str]:
    return [f"{name} {value:g} {unit} is above {whose}, {limit:g} {unit}"] if value > limit else []
