"""What of the running bench can be read and turned by name, from a test or from the control channel."""

import math
from collections.abc import Callable
from typing import NamedTuple

from mock_devices.bench import Bench
from rig.errors import UsageError
from rig.registry import known

Value = float | bool


class Dial(NamedTuple):
    """One figure of the bench; without ``turn`` it can only be read, with ``switch`` it is true or false."""

    meaning: str
    read: Callable[[Bench], Value]
    turn: Callable[[Bench, float], None] | None = None
    low: float = -math.inf
    high: float = math.inf
    switch: bool = False


def _move_surface(bench: Bench, position_mm: float) -> None:
    bench.limb.wanted_mm = position_mm


def _stiffen(bench: Bench, scale: float) -> None:
    bench.tissue.stiffness_scale = scale


def _include(bench: Bench, stiffness_N_mm: float) -> None:
    bench.tissue.inclusion_N_mm = stiffness_N_mm


def _sink_inclusion(bench: Bench, depth_mm: float) -> None:
    bench.tissue.inclusion_mm = depth_mm


def _hurry(bench: Bench, speed_mm_s: float) -> None:
    bench.limb.speed_limit_mm_s = speed_mm_s


def _place_tissue(bench: Bench, present: float) -> None:
    bench.tissue.present = bool(present)


def _zero(bench: Bench, zero_N: float) -> None:
    bench.force.zero[bench.force.axis] = zero_N


def _press(bench: Bench, weight_N: float) -> None:
    bench.weight_N = weight_N


def _push_aside(bench: Bench, lateral_N: float) -> None:
    bench.force.lateral_N = bench.force_modbus.lateral_N = lateral_N


def _show_tip(bench: Bench, seen: float) -> None:
    bench.tracker.tip_in_view = bool(seen)


def _show_arm(bench: Bench, seen: float) -> None:
    bench.tracker.arm_in_view = bool(seen)


DIALS: dict[str, Dial] = {
    "time_s": Dial("time simulated since the bench started", lambda bench: bench.time_s),
    "axis.position_mm": Dial("true position of the carriage", lambda bench: bench.axis.position_mm),
    "axis.velocity_mm_s": Dial("true velocity of the carriage", lambda bench: bench.axis.velocity_mm_s),
    "axis.target_mm": Dial("last set-point the drive was given", lambda bench: bench.axis.target_mm),
    "axis.current_A": Dial("motor current", lambda bench: bench.axis.current_A),
    "axis.powered": Dial("whether the motor has torque", lambda bench: bench.axis.powered),
    "tip.position_mm": Dial("true position of the tip", lambda bench: bench.tip_mm),
    "tip.velocity_mm_s": Dial("true velocity of the tip", lambda bench: bench.tip_speed_mm_s),
    "tip.depth_mm": Dial("tip below the surface", lambda bench: bench.tip_mm - bench.limb.position_mm),
    "tip.force_N": Dial("true force of the tissue on the tip", lambda bench: bench.contact_N),
    "surface.position_mm": Dial(
        "where the limb's surface is; set: where it goes", lambda bench: bench.limb.position_mm, _move_surface, -50, 150
    ),
    "surface.speed_mm_s": Dial(
        "how fast the limb goes to where it was told", lambda bench: bench.limb.speed_limit_mm_s, _hurry, 0.01, 1000
    ),
    "tissue.inclusion_mm": Dial(
        "depth at which something stiff begins", lambda bench: bench.tissue.inclusion_mm, _sink_inclusion, 0, 100
    ),
    "tissue.inclusion_N_mm": Dial(
        "what it adds per millimetre; 0: there is none", lambda bench: bench.tissue.inclusion_N_mm, _include, 0, 100
    ),
    "tissue.stiffness_scale": Dial(
        "factor on the elastic force", lambda bench: bench.tissue.stiffness_scale, _stiffen, 0, 20
    ),
    "tissue.present": Dial(
        "whether there is a limb at all", lambda bench: bench.tissue.present, _place_tissue, switch=True
    ),
    "load.axial_N": Dial(
        "weight on the tip along the axis, below 0: hanging from it", lambda bench: bench.weight_N, _press, -200, 200
    ),
    "load.lateral_N": Dial(
        "push on the tip across the axis", lambda bench: bench.force.lateral_N, _push_aside, -200, 200
    ),
    "force.zero_N": Dial("zero of the axial channel", lambda bench: bench.force.zero[bench.force.axis], _zero),
    "force.temperature_C": Dial("inside the sensor", lambda bench: bench.force.temperature_C),
    "tracker.tip_in_view": Dial("tool tip seen", lambda bench: bench.tracker.tip_in_view, _show_tip, switch=True),
    "tracker.arm_in_view": Dial("tool arm seen", lambda bench: bench.tracker.arm_in_view, _show_arm, switch=True),
}


def get(bench: Bench, name: str) -> Value:
    """The figure ``name`` now; raises UsageError."""
    return DIALS[known(name, DIALS, "figure")].read(bench)


def turn(bench: Bench, name: str, value: object) -> None:
    """Sets ``name`` to ``value``; raises UsageError."""
    settable = [key for key, dial in DIALS.items() if dial.turn]
    dial = DIALS[known(name, settable, "settable figure")]
    number = _checked(name, dial, value)
    if dial.turn:
        dial.turn(bench, number)


def _checked(name: str, dial: Dial, value: object) -> float:
    if dial.switch:
        if isinstance(value, bool):
            return float(value)
        raise UsageError(f"{name} is switched with true or false, not with {value!r}")
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise UsageError(f"{name} takes a number, not {value!r}")
    if not dial.low <= value <= dial.high:
        raise UsageError(f"{name} = {value:g} is outside {dial.low:g} to {dial.high:g}")
    return float(value)
