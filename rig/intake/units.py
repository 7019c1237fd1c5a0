"""Units as people write them behind a name or under it, and what they are in the project's own."""

import re

from rig.errors import DataError

# Factor to the project's unit of each quantity: SI prefixes, NIST SP 811 B.8 (pound-force, inch, kilogram-force).
TIME_NS = {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9, "sec": 1e9, "seconds": 1e9, "min": 60e9, "h": 3600e9}
FORCE_N = {
    "N": 1.0, "kN": 1e3, "mN": 1e-3, "uN": 1e-6, "MN": 1e6, "gf": 9.80665e-3, "kgf": 9.80665, "lbf": 4.4482216152605,
}  # fmt: skip
LENGTH_MM = {"mm": 1.0, "m": 1e3, "cm": 10.0, "um": 1e-3, "nm": 1e-6, "inch": 25.4, "in": 25.4, "mil": 0.0254}
SPEED_MM_S = {
    "mm/s": 1.0, "m/s": 1e3, "um/s": 1e-3, "cm/s": 10.0, "mm/min": 1 / 60, "in/s": 25.4, "in/min": 25.4 / 60,
}  # fmt: skip
# A rotary axis is mapped with the lever at which its torque is a force and its angle a way.
TORQUE_N_MM = {"N m": 1e3, "Nm": 1e3, "N*m": 1e3, "N mm": 1.0, "Nmm": 1.0, "mN m": 1.0, "mNm": 1.0}
ANGLE_RAD = {"rad": 1.0, "deg": 0.017453292519943295, "°": 0.017453292519943295, "turn": 6.283185307179586}
RATE_RAD_S = {"rad/s": 1.0, "deg/s": 0.017453292519943295, "r/min": 0.10471975511965977, "rpm": 0.10471975511965977}
CURRENT_A = {"A": 1.0, "mA": 1e-3}
TEMPERATURE_C = {"C": 1.0, "°C": 1.0, "degC": 1.0}
# Known, but no measure of a quantity of ours: a column in one of them needs its scale.
RAW = ("V", "mV", "uV", "count", "counts", "%", "Pa", "kPa", "MPa", "1", "g", "kg", "lb")

LINEAR = {
    "time": TIME_NS, "arrival": TIME_NS, "force": FORCE_N, "position": LENGTH_MM, "velocity": SPEED_MM_S,
    "current": CURRENT_A, "temperature": TEMPERATURE_C, "x": LENGTH_MM, "y": LENGTH_MM, "z": LENGTH_MM,
}  # fmt: skip
ROTARY = {"force": TORQUE_N_MM, "position": ANGLE_RAD, "velocity": RATE_RAD_S}
UNITS = frozenset(RAW).union(*LINEAR.values(), *ROTARY.values())


def unit_in(text: str) -> str:
    """``text`` as a unit (``(mm)``, ``[N]``, ``µm``), empty where it is none that is known."""
    bare = text.strip().strip("()[]{}<>").strip().replace("µ", "u").replace("μ", "u").replace("·", " ")
    return bare if bare in UNITS else ""


def unit_of(name: str) -> str:
    """The unit a column's name ends in (``force_kN``, ``Force [kN]``, ``x (mm)``); empty if it names none."""
    found = re.search(r"^.*?[\s_]*(?:[(\[{]([^)\]}]*)[)\]}]|(?<=[\s_/,])([^\s_,()\[\]]+))\s*$", name.strip())
    return unit_in(found[1] or found[2] or "") if found else ""


def factor_of(quantity: str, unit: str, lever_mm: float | None = None) -> float:
    """What a number in ``unit`` is multiplied by to be in the project's unit; raises DataError naming those known.

    A torque over the lever is a force, and an angle times it a way.
    """
    if unit in LINEAR[quantity]:
        return LINEAR[quantity][unit]
    rotary = ROTARY.get(quantity, {})
    if unit not in rotary:
        raise DataError(f"{unit!r} is no unit of {quantity}; known are {', '.join((*LINEAR[quantity], *rotary))}")
    if lever_mm is None:
        raise DataError(f"{unit!r} turns; state the lever at which it is a {quantity}, for example lever_mm = 1000.0")
    return rotary[unit] / lever_mm if quantity == "force" else rotary[unit] * lever_mm
