"""Every speed beside its goal: ``python -m benchmarks.all [--quick] [--only NAME]``; the last line is one JSON object.

Each benchmark is a program of its own that ends with one JSON line; what of it counts stands in ``PARTS``. One that is
absent, fails before that line, or does not say what is asked of it is a row that missed.
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec

from pydantic import JsonValue

from benchmarks.control.goals import GOALS, JUMPS, LOW_JUMPS, PEAK

QUICK_S, WHOLE_S = 200.0, 1800.0  # for each: one alone takes as long in its quick form, and all together six minutes


@dataclass(frozen=True)
class Measure:
    """One row. ``here`` and ``rival`` say where in the JSON they stand, keys with dots; the goal bounds their ratio,
    or ``here`` where there is no rival. ``whole``: the quick form does not say it."""

    work: str
    here: str
    goal: float
    unit: str = ""
    rival: str = ""
    is_least: bool = False
    whole: bool = False


@dataclass(frozen=True)
class Part:
    """A benchmark: its arguments, those of its quick form, and what counts of it."""

    name: str
    whole: Sequence[str]
    quick: Sequence[str]
    measures: Sequence[Measure]


@dataclass(frozen=True)
class Row:
    """What was found; numbers are None where the benchmark did not say them, ``why`` then says why."""

    work: str
    here: float | None
    unit: str
    rival: str
    rival_value: float | None
    ratio: float | None
    goal: str
    met: bool
    why: str = ""


PARTS: Sequence[Part] = (
    Part("benchmarks.loop", (), ("--seconds", "5", "--rounds", "1"), (
        Measure("sensor to drive, p50", "idle.sensor to drive p50 us", 200.0, "us"),
        Measure("sensor to drive, p99", "idle.sensor to drive p99 us", 500.0, "us"),
        Measure("execution of a cycle, p99", "idle.execution p99 us", 150.0, "us"),
        Measure("waking, p99", "idle.wake p99 us", 1.3, "us", "idle.cyclictest p99 us"),
        Measure("waking under HTTP load, p99", "http.wake p99 us", 1.3, "us", "http.cyclictest p99 us"),
    )),
    Part("benchmarks.recording", ("--hour",), ("--minutes", "1"), (
        Measure("recorder, three streams at 1 kHz", "recorder_core_percent", 0.3, "% of a core"),
        Measure("rows recorded without loss", "sustained_rows_s", 200_000, "rows/s", is_least=True),
        Measure("reading a row", "read_us_row", 0.3, "us"),
        Measure("reading a row", "read_us_row", 0.1, "us", "stock_us_row"),
        Measure("reading a row", "read_us_row", 1.1, "us", "h5py_us_row"),
        Measure("reading an hour of three streams", "hour_s", 5.0, "s", whole=True),
        Measure("reading an hour of three streams", "hour_GB", 1.5, "GB", whole=True),
    )),
    Part("benchmarks.start", (), ("--repeats", "1"), (
        Measure("slowest --help of all commands", "slowest_help_s", 0.35, "s"),
        Measure("rig simulate, first result", "simulate.clock_s", 2.0, "s"),
    )),
    Part("benchmarks.environment", (), (), (Measure("installed, without development tools", "whole_MiB", 700, "MiB"),)),
    Part("benchmarks.control", ("--seeds", "1"), ("--quick",), (
        *(Measure(f"limb at 2 Hz, {force} N, constant over law",
                  f"limb_2Hz_gain.{force}", goal, "x", is_least=True) for force, goal in GOALS.items()),
        Measure("low jumps, settling, constant over law", "low_jump_settling_gain", LOW_JUMPS, "x",
                is_least=True),
        Measure("jumps, settling, constant over law", "jump_settling_gain", JUMPS, "x", is_least=True),
        Measure("contact, peak over that of the gentlest constant", "contact_peak", PEAK, "x"),
    )),
    Part("benchmarks.lattice", ("--part", "force"), ("--part", "force"), (
        Measure("lattice, constant", "force_ms.constant.ours", 0.13, "ms", "force_ms.constant.numpy slices"),
        Measure("lattice, exponential", "force_ms.exponential.ours", 0.13, "ms", "force_ms.exponential.numpy slices"),
        Measure("lattice, constant", "force_ms.constant.ours", 0.75, "ms", "force_ms.constant.tuned numpy"),
        Measure("lattice, constant", "force_ms.constant.ours", 0.6, "ms", "force_ms.constant.portable C"),
        Measure("lattice, exponential", "force_ms.exponential.ours", 0.7, "ms", "force_ms.exponential.portable C"),
    )),
    Part("benchmarks.mesh", (), ("--quick",), (
        Measure("stiffness of the finest meshes, off the layer's", "off_percent", 1.0, "%"),
    )),
    Part("benchmarks.cohort", (), ("--quick",), (
        Measure("50 sessions fitted", "fifty_s", 60.0, "s"),
        Measure("the same from what is kept, beside fitting", "kept_s", 0.5, "s", "fit_s"),
    )),
    Part("benchmarks.growth", (), ("--quick",), tuple(
        Measure(f"growth with {name}, exponent of {what}", f"{name}.{key}", 1.1)
        for name in ("trials", "samples", "sessions", "vertices", "clients")
        for what, key in (("time", "exponent"), ("memory", "memory_exponent"))
    )),
)  # fmt: skip


def last_json(text: str) -> JsonValue:
    """The JSON object in the last line that is one; raises ValueError where none is."""
    for line in reversed(text.splitlines()):
        if line.startswith("{"):
            found: JsonValue = json.loads(line)
            return found
    raise ValueError("it ended without a line of JSON")


def number_at(found: JsonValue, place: str) -> float:
    """The number that stands at ``place``, a key with dots in it where the keys have none; raises KeyError."""
    at, rest = found, place
    while rest and isinstance(at, Mapping):
        key = next((key for key in at if rest == key or rest.startswith(f"{key}.")), None)
        if key is None:
            break
        at, rest = at[key], rest[len(key) + 1 :]
    if rest or not isinstance(at, int | float):
        raise KeyError(place)
    return float(at)


def row_of(measure: Measure, found: JsonValue) -> Row:
    """The row of what a benchmark said."""
    try:
        here = number_at(found, measure.here)
        rival = number_at(found, measure.rival) if measure.rival else None
    except KeyError as error:
        return missed(measure, f"it does not say {error}")
    judged = here if rival is None else here / rival
    met = judged >= measure.goal if measure.is_least else judged <= measure.goal
    return Row(measure.work, here, measure.unit, _rival(measure), rival, None if rival is None else judged,
               _goal(measure), met)  # fmt: skip


def missed(measure: Measure, why: str) -> Row:
    """The row of a benchmark that said nothing."""
    return Row(measure.work, None, measure.unit, _rival(measure), None, None, _goal(measure), False, why)


def _rival(measure: Measure) -> str:
    return measure.rival.rpartition(".")[2]


def _goal(measure: Measure) -> str:
    return f"{'at least' if measure.is_least else 'at most'} {measure.goal:g}{' x' if measure.rival else ''}"


def rows_of(part: Part, quick: bool) -> list[Row]:
    """Runs one benchmark."""
    asked = [one for one in part.measures if not (quick and one.whole)] or [Measure(part.name, "", 0.0)]
    try:
        found = _run(part, quick)
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        return [missed(measure, f"{part.name}: {error}") for measure in asked]
    own = found.get("rows") if isinstance(found, Mapping) else None
    if not part.measures and isinstance(own, list):
        return [row for each in own if isinstance(each, Mapping) for row in [_own_row(each)]]
    return [row_of(measure, found) for measure in asked]


def _own_row(said: Mapping[str, JsonValue]) -> Row:
    """A row of a benchmark that judges itself: work, here, rival, ratio, goal, met."""
    here, ratio = (value if isinstance(value, int | float) else None for value in (said.get("here"), said.get("ratio")))
    return Row(str(said.get("work", "")), here, str(said.get("unit", "")), str(said.get("rival", "")), None, ratio,
               str(said.get("goal", "")), said.get("met") is True)  # fmt: skip


def _run(part: Part, quick: bool) -> JsonValue:
    if find_spec(part.name) is None:
        raise ValueError("there is no such benchmark")
    command = [sys.executable, "-m", part.name, *(part.quick if quick else part.whole)]
    limit_s = QUICK_S if quick else WHOLE_S
    done = subprocess.run(command, capture_output=True, text=True, timeout=limit_s, check=False)
    try:
        return last_json(done.stdout)  # also of one that ends with 1 because of what it found
    except ValueError:
        if not done.returncode:
            raise
    said = (done.stderr.strip() or done.stdout.strip()).splitlines()
    raise ValueError(f"ended with {done.returncode}: {said[-1] if said else 'without a word'}")


def line_of(row: Row) -> str:
    """One line of the table."""
    here = "-" if row.here is None else f"{row.here:.3g} {row.unit}"
    ratio = "" if row.ratio is None else f"{row.ratio:.2f} x"
    met = "met" if row.met else "missed"
    return f"{row.work:50} {here:>16} {row.rival:>18} {ratio:>8} {row.goal:>16}  {met:6} {row.why}".rstrip()


def main(parts: Sequence[Part] = PARTS) -> None:
    """Prints the table; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="each in its quick form, all in ten minutes")
    parser.add_argument("--only", action="append", help="benchmarks.NAME; may be repeated")
    options = parser.parse_args()
    rows: list[Row] = []
    for part in parts:
        if options.only and part.name not in options.only:
            continue
        began = time.monotonic()
        found = rows_of(part, options.quick)
        rows += found
        print(*map(line_of, found), sep="\n", flush=True)
        print(f"  {part.name} took {time.monotonic() - began:.0f} s", file=sys.stderr)
    met = sum(row.met for row in rows)
    print(json.dumps({"met": met, "missed": len(rows) - met, "rows": [asdict(row) for row in rows]}))


if __name__ == "__main__":
    main()
