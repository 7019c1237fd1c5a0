"""What of the running bench can be read and written by name, from a test or from the control channel."""

import math
from collections.abc import Callable
from typing import NamedTuple

from mock_devices.bench import Bench
from rig.errors import UsageError
from rig.registry import known

Value = float | bool


class Quantity(NamedTuple):
    """One quantity of the bench; without ``write`` it can only be read, with ``switch`` it is true or false."""

    meaning: str
    read: Callable[[Bench], Value]
    write: Callable[[Bench, Value], None] | None = None
    low: float = -math.inf
    high: float = math.inf
    switch: bool = False


def _setting(path: str) -> Callable[[Bench, Value], None]:
    """What sets the attribute at ``path`` below the bench."""
    owner, _, attribute = path.partition(".")
    return lambda bench, value: setattr(getattr(bench, owner), attribute, value)


def _zero(bench: Bench, zero_N: float) -> None:
    bench.force.zero[bench.force.axis] = zero_N


def _press(bench: Bench, weight_N: float) -> None:
    bench.weight_N = weight_N


def _push_aside(bench: Bench, lateral_N: float) -> None:
    bench.force.lateral_N = bench.force_modbus.lateral_N = lateral_N


QUANTITIES: dict[str, Quantity] = {
    "time_s": Quantity("time simulated since the bench started", lambda bench: bench.time_s),
    "axis.position_mm": Quantity("true position of the carriage", lambda bench: bench.axis.position_mm),
    "axis.velocity_mm_s": Quantity("true velocity of the carriage", lambda bench: bench.axis.velocity_mm_s),
    "axis.target_mm": Quantity("last set-point the drive was given", lambda bench: bench.axis.target_mm),
    "axis.current_A": Quantity("motor current", lambda bench: bench.axis.current_A),
    "axis.powered": Quantity("whether the motor has torque", lambda bench: bench.axis.powered),
    "tip.position_mm": Quantity("true position of the tip", lambda bench: bench.tip_mm),
    "tip.velocity_mm_s": Quantity("true velocity of the tip", lambda bench: bench.tip_speed_mm_s),
    "tip.depth_mm": Quantity("tip below the surface", lambda bench: bench.tip_mm - bench.limb.position_mm),
    "tip.force_N": Quantity("true force of the tissue on the tip", lambda bench: bench.contact_N),
    "surface.position_mm": Quantity(
        "where the limb's surface is; set: where it goes",
        lambda bench: bench.limb.position_mm,
        _setting("limb.wanted_mm"),
        -50,
        150,
    ),
    "surface.speed_mm_s": Quantity(
        "how fast the limb goes to where it was told",
        lambda bench: bench.limb.speed_limit_mm_s,
        _setting("limb.speed_limit_mm_s"),
        0.01,
        1000,
    ),
    "tissue.inclusion_mm": Quantity(
        "depth at which something stiff begins",
        lambda bench: bench.tissue.inclusion_mm,
        _setting("tissue.inclusion_mm"),
        0,
        100,
    ),
    "tissue.inclusion_N_mm": Quantity(
        "what it adds per millimetre; 0: there is none",
        lambda bench: bench.tissue.inclusion_N_mm,
        _setting("tissue.inclusion_N_mm"),
        0,
        100,
    ),
    "tissue.stiffness_scale": Quantity(
        "factor on the elastic force",
        lambda bench: bench.tissue.stiffness_scale,
        _setting("tissue.stiffness_scale"),
        0,
        20,
    ),
    "tissue.present": Quantity(
        "whether there is a limb at all", lambda bench: bench.tissue.present, _setting("tissue.present"), switch=True
    ),
    "load.axial_N": Quantity(
        "weight on the tip along the axis, below 0: hanging from it", lambda bench: bench.weight_N, _press, -200, 200
    ),
    "load.lateral_N": Quantity(
        "push on the tip across the axis", lambda bench: bench.force.lateral_N, _push_aside, -200, 200
    ),
    "force.zero_N": Quantity("zero of the axial channel", lambda bench: bench.force.zero[bench.force.axis], _zero),
    "force.temperature_C": Quantity("inside the sensor", lambda bench: bench.force.temperature_C),
    "tracker.tip_in_view": Quantity(
        "tool tip seen", lambda bench: bench.tracker.tip_in_view, _setting("tracker.tip_in_view"), switch=True
    ),
    "tracker.arm_in_view": Quantity(
        "tool arm seen", lambda bench: bench.tracker.arm_in_view, _setting("tracker.arm_in_view"), switch=True
    ),
}


def read(bench: Bench, name: str) -> Value:
    """The quantity ``name`` now; raises UsageError."""
    return QUANTITIES[known(name, QUANTITIES, "quantity")].read(bench)


def write(bench: Bench, name: str, value: object) -> None:
    """Sets ``name`` to ``value``; raises UsageError."""
    settable = [key for key, quantity in QUANTITIES.items() if quantity.write]
    quantity = QUANTITIES[known(name, settable, "settable quantity")]
    checked = _checked(name, quantity, value)
    if quantity.write:
        quantity.write(bench, checked)


def _checked(name: str, quantity: Quantity, value: object) -> Value:
    if quantity.switch:
        if isinstance(value, bool):
            return value
        raise UsageError(f"{name} takes true or false, not with {value!r}")
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise UsageError(f"{name} takes a number, not {value!r}")
    if not quantity.low <= value <= quantity.high:
        raise UsageError(f"{name} = {value:g} is outside {quantity.low:g} to {quantity.high:g}")
    return float(value)
