"""Units as people write them behind a name or under it, and what they are in the project's own."""

import re
import unicodedata
from typing import NamedTuple

from rig.errors import DataError

# Factor to the project's unit of each quantity: SI prefixes, NIST SP 811 B.8 (pound-force, inch, kilogram-force).
TIME_NS = {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9, "min": 60e9, "h": 3600e9}
FORCE_N = {
    "N": 1.0, "kN": 1e3, "mN": 1e-3, "uN": 1e-6, "nN": 1e-9, "pN": 1e-12, "cN": 1e-2, "daN": 10.0, "MN": 1e6,
    "dyn": 1e-5, "gf": 9.80665e-3, "kgf": 9.80665, "lbf": 4.4482216152605, "ozf": 4.4482216152605 / 16,
    "kip": 4448.2216152605,
}  # fmt: skip
# Of a force, a mass is the weight of it: so texture analysers and balances write.
FORCE_N |= {"g": FORCE_N["gf"], "kg": FORCE_N["kgf"], "lb": FORCE_N["lbf"], "oz": FORCE_N["ozf"], "kp": FORCE_N["kgf"]}
LENGTH_MM = {"mm": 1.0, "m": 1e3, "cm": 10.0, "um": 1e-3, "nm": 1e-6, "inch": 25.4, "in": 25.4, "mil": 0.0254}
LENGTH_MM |= {"ft": 304.8, "Å": 1e-7}
SPEED_MM_S = {
    "mm/s": 1.0, "m/s": 1e3, "um/s": 1e-3, "cm/s": 10.0, "mm/min": 1 / 60, "in/s": 25.4, "in/min": 25.4 / 60,
}  # fmt: skip
# A rotary axis is mapped with the lever at which its torque is a force and its angle a way.
TORQUE_N_MM = {"N m": 1e3, "Nm": 1e3, "N*m": 1e3, "N mm": 1.0, "Nmm": 1.0, "mN m": 1.0, "mNm": 1.0}
TORQUE_N_MM |= {"lbf ft": 4.4482216152605 * 304.8, "lbf in": 4.4482216152605 * 25.4}
ANGLE_RAD = {"rad": 1.0, "deg": 0.017453292519943295, "°": 0.017453292519943295, "turn": 6.283185307179586}
RATE_RAD_S = {"rad/s": 1.0, "deg/s": 0.017453292519943295, "r/min": 0.10471975511965977, "rpm": 0.10471975511965977}
CURRENT_A = {"A": 1.0, "mA": 1e-3}
TEMPERATURE_C = {"C": 1.0, "°C": 1.0, "degC": 1.0}
# Of forces that benches for tissue reach no meganewton: whoever writes MN may well mean millinewtons.
AMBIGUOUS = "MN"
# What a sensor gives before it is calibrated: a column in one of them needs its scale.
SIGNALS = ("V", "mV", "uV", "count", "counts")
# Known, but no measure of a quantity of ours.
RAW = (*SIGNALS, "%", "Pa", "kPa", "MPa", "1")
_PREFIXES = {"": "", "kilo": "k", "centi": "c", "milli": "m", "micro": "u", "nano": "n"}
_WORDS = {"newton": "N", "meter": "m", "metre": "m"}
_MASSES = {"gram": "gf", "kilogram": "kgf", "pound": "lbf", "ounce": "ozf"}
# Other spellings, in small letters: plurals, whole words, other scripts, and units that mean nothing else in capitals.
SPELLINGS = {
    **dict.fromkeys(("sec", "secs", "second", "seconds", "sekunden", "秒", "초", "с", "сек"), "s"),
    **dict.fromkeys(("msec", "millis", "millisecond", "milliseconds", "毫秒", "ミリ秒", "мс"), "ms"),
    **dict.fromkeys(("usec", "usecs", "micros", "microsec", "microsecond", "microseconds", "微秒"), "us"),
    **dict.fromkeys(("nsec", "nsecs", "nanosec", "nanosecs", "nanosecond", "nanoseconds", "纳秒"), "ns"),
    **dict.fromkeys(("minute", "minutes", "分"), "min"),
    **{f"{prefix}{word}{plural}": f"{letter}{unit}" for prefix, letter in _PREFIXES.items()
       for word, unit in _WORDS.items() for plural in ("", "s")},
    **{f"{word}{plural}{force}": unit for word, unit in _MASSES.items() for plural in ("", "s")
       for force in ("", "-force", " force")},
    **dict.fromkeys(("牛", "牛顿", "ニュートン", "н"), "N"), **dict.fromkeys(("千牛", "кн"), "kN"), "克": "g",
    **dict.fromkeys(("毫米", "ミリ", "мм"), "mm"), "米": "m", **dict.fromkeys(("mils", "thou", "thous"), "mil"),
    **dict.fromkeys(("micron", "microns", "微米", "мкм"), "um"), **dict.fromkeys(("foot", "feet"), "ft"),
    **{unit.lower(): unit for unit in ("s", "ms", "min", "kN", "gf", "kgf", "lbf", "ozf", "kg", "lb", "oz")},
    **{unit: unit for unit in ("mm", "cm", "um", "in", "inch")},
    **dict.fromkeys(("inches", '"'), "inch"), "kgs": "kg", "lbs": "lb", "volt": "V", "volts": "V",
    **{f"{length}{sign}{mass}": f"lbf {length}" for length in ("ft", "in") for sign in ("-", " ", ".", "")
       for mass in ("lb", "lbs", "lbf")},
    **{f"{mass}{sign}{length}": f"lbf {length}" for length in ("ft", "in") for sign in ("-", " ", ".")
       for mass in ("lb", "lbs", "lbf")},
    **{f"n{sign}m": "N m" for sign in "-."}, **{f"n{sign}mm": "N mm" for sign in "-."},
    **dict.fromkeys(("newton-meter", "newton-meters", "newton meter", "newton meters", "newton-metres"), "N m"),
    **dict.fromkeys(("deg", "degree", "degrees"), "deg"), **dict.fromkeys(("radian", "radians"), "rad"),
}  # fmt: skip

LINEAR = {
    "time": TIME_NS, "arrival": TIME_NS, "force": FORCE_N, "position": LENGTH_MM, "velocity": SPEED_MM_S,
    "current": CURRENT_A, "temperature": TEMPERATURE_C, "x": LENGTH_MM, "y": LENGTH_MM, "z": LENGTH_MM,
    "setpoint": LENGTH_MM, "load_position": LENGTH_MM, "excitation": {},
}  # fmt: skip
ROTARY = {
    "force": TORQUE_N_MM, "position": ANGLE_RAD, "velocity": RATE_RAD_S, "setpoint": ANGLE_RAD,
    "load_position": ANGLE_RAD,
}  # fmt: skip
UNITS = frozenset(RAW).union(*LINEAR.values(), *ROTARY.values())

# What a column of units is called, and a line above a table that states one.
UNIT_WORDS = frozenset(("unit", "units", "einheit", "einheiten", "unité", "单位", "単位"))

# As `(10^-3 N)` and `(1/100 mm)`: whether numbers are so many times as large, or as small, only their maker knows.
_SEVERAL = re.compile(r"[(\[{]\s*([x×*]?\s*\d[\d.,^/eE+\-−⁻]*\s*[x×*]?\s*([^\W\d_]+))\s*[)\]}]")
# In names of these a length by a time is a speed: `speed_in_s`; the `in` of `time_in_s` is none.
_FAST = re.compile(r"(?<![A-Za-z])(?i:speed|vel|rate|feed)|Speed|Vel|Rate|Feed")
# Of ROS messages the vectors with units (REP 103: standard units and coordinate conventions).
ROS_UNITS = {"force": "N", "torque": "N m", "position": "m", "translation": "m"}


def unit_in(text: str) -> str:
    """``text`` as a unit (``(mm)``, ``[N]``, ``µm``, ``sec``, ``（秒）``), empty where it is none that is known."""
    bare = _plain(text).strip().strip("()[]{}<>").strip()
    bare = bare[:-1] if bare[:-1].isalpha() and bare.endswith(".") else bare  # in. and sec.
    if bare not in UNITS and bare.count("/") == 1:  # deg/sec, mm/second
        rate = "/".join(map(unit_in, bare.split("/")))
        return rate if rate in UNITS else ""
    return bare if bare in UNITS else SPELLINGS.get(bare.lower(), "")


def _plain(text: str) -> str:
    """Wide letters and brackets as narrow ones, a micro sign as u, a middle dot as a blank."""
    return unicodedata.normalize("NFKC", text).replace("μ", "u").replace("·", " ")


def unknown_unit(name: str) -> str:
    """What stands in brackets behind a name like a unit and is none that is known, or so many of one; else empty."""
    if several := _SEVERAL.search(_plain(name)):
        return several[1] if unit_in(several[2]) else ""
    found = re.findall(r"[(\[{]\s*(u|[^\W\d_]{2,9}(?:-[^\W\d_]+)?)\s*[)\]}]", _plain(name))
    return next((text for text in found if not unit_in(text)), "")


def unit_of(name: str) -> str:
    """The unit a column's name ends in, or has in brackets (``force_kN``, ``Force [kN]``, ``x (mm) left``), or is.

    Empty if it names none. One letter alone is a name and no unit, and a 1 in brackets counts columns. Of two units one
    is by the other (``speed_mm_s``), and one that is not known so is none: ``stiffness_N_mm`` is no way.
    """
    plain = re.sub(r"\.\.(.+)\.$", r" (\1)", _plain(name).strip())  # as R makes names
    two = re.search(r"(?<=[\s_])([^\W_]+)[\s_](?:per[\s_])?([^\W_]+)$", plain)
    parts = [unit_in(part) for part in two.groups()] if two else [""]
    rate = "/".join(parts) if all(parts) else ""
    if rate and (parts[0] != "in" or (rate in UNITS and _FAST.search(plain))):
        return rate if rate in UNITS else ""
    ending = re.search(r"(?<=[\s_/,.])([^\s_/,.()\[\]{}][^\s_,.()\[\]{}]*)\.?$", plain)
    bracketed = re.findall(r"[(\[{]([^)\]}]*)[)\]}]", plain)[::-1]
    found = [*bracketed, ending[1] if ending else "", plain if plain[1:] else ""]
    return next((unit for unit in map(unit_in, found) if unit not in ("", "1")), "")


class Meant(NamedTuple):
    """Units that may be meant; ``sure`` where it is one, by its own letters or by those of the name."""

    units: list[str]
    sure: bool


def meant(quantity: str, name: str, unit: str) -> Meant:
    """The units of the quantity that ``unit``, or what ``name`` ends in where that is empty, may be in capitals.

    Machines write names in capitals, and then MN is a millinewton or a meganewton, NM a nanometre or a newton metre.
    """
    plain, known = _plain(name).strip(), (*LINEAR[quantity], *ROTARY.get(quantity, {}))
    if unit and unit != AMBIGUOUS:
        return Meant([unit] if unit in known else [], unit in known)
    if _SEVERAL.search(plain):
        return Meant([], False)
    ending = re.search(r"(?:(?<=[\s_/,.(\[{])|(?<=[a-z])(?=[A-Z]))([^\W\d_]{1,3})[)\]}]?$", plain)
    text = unit or (unit_in(ending[1]) or ending[1] if ending else "")
    found = [text] if text in known and text != AMBIGUOUS else [own for own in known if own.lower() == text.lower()]
    is_told = found == [text] or plain.isupper() or (text.istitle() and len(text) > 1)  # as in PositionUm
    return Meant(found, len(found) == 1 and is_told)


def factor_of(quantity: str, unit: str, lever_mm: float | None = None) -> float:
    """What a number in ``unit`` is multiplied by, at the lever if it turns; raises DataError naming those known."""
    if unit in LINEAR[quantity]:
        return LINEAR[quantity][unit]
    rotary = ROTARY.get(quantity, {})
    if unit not in rotary:
        raise DataError(f"{unit!r} is no unit of {quantity}; known are {', '.join((*LINEAR[quantity], *rotary))}")
    if lever_mm is None:
        raise DataError(f"{unit!r} turns; state the lever at which it is a {quantity}, for example lever_mm = 1000.0")
    return rotary[unit] / lever_mm if quantity == "force" else rotary[unit] * lever_mm


def ros_unit(name: str) -> str:
    """The unit that ROS lays down for the parts of a message (REP 103), empty for others."""
    parts = name.split(".")
    return ROS_UNITS.get(parts[-2], "") if len(parts) > 1 and parts[-1] in ("x", "y", "z") else ""
