"""Processor time of `rig diagnose`, pictures included: ``python -m benchmarks.diagnose [--only one three hundred]``.

Sessions come from `benchmarks.hidden`: trials of 8 s at 1 kHz with a marker, written as tables, one cause or three
hidden in them. Timed is the command as a process of its own, from its start to its last picture, with one thread. A
rival gets the first session too: one bounded least-squares fit of the simulation with all causes at once, which names
what differs from nothing by two standard errors. Each figure stands beside its goal; the last line is one JSON object;
exit 1 where a goal was missed. The loop of exponentials that is timed beside them tells how busy the machine was.
"""

import argparse
import json
import os
import resource
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from subprocess import DEVNULL, run
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
from scipy.optimize import least_squares

from benchmarks.hidden.draw import draw_secret, session_of
from benchmarks.hidden.truth import Bench, Hidden, IndentationCycle, draw_bench
from benchmarks.hidden.truth import run as recorded
from benchmarks.imported import mapping
from rig.diagnosis.descent import from_internal, to_internal
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.noise import Array
from rig.diagnosis.observations import observe
from rig.diagnosis.problem import Par
from rig.diagnosis.search import testable

SECONDS, SEED, STEPS_EACH = 8.0, 3, 4  # of the generator's 4 kHz: a sample each millisecond
MOST_EVALUATIONS = 60  # of the rival; by then it moves in its fourth digit
SURE = 1.96
NOISE = (0.006, 0.05)  # of force [N] and tracker [mm], as the generator has them on average


@dataclass(frozen=True)
class Case:
    """A session, and how many seconds of processor time its diagnosis may take."""

    trials: int
    causes: tuple[str, ...]
    goal_s: float


THREE = ("friction", "relaxation", "substrate")
CASES = {"one": Case(15, ("friction",), 10.0), "three": Case(15, THREE, 30.0), "hundred": Case(100, ("friction",), 0.0)}
MOST_TIMES = 4.0  # what a hundred trials may take, in times of what fifteen do


@dataclass(frozen=True)
class Took:
    """Seconds of processor time, memory at its highest [MB], and what was named with certainty, or by the rival."""

    cpu_s: float
    most_MB: float
    named: tuple[str, ...]


def bench_of(count: int, rng: np.random.Generator) -> Bench:
    """A limb nobody chose, pressed at five speeds and held so long that each trial takes 8 s."""
    bench, depth_mm, dwell_s = draw_bench(rng, count), 7.0, 0.4
    speeds = np.resize([5.0, 8.0, 12.0, 18.0, 28.0], count)
    way_mm = bench.clearance + depth_mm
    hold_s = SECONDS - 2 * dwell_s - way_mm / speeds - way_mm / bench.retract
    return replace(
        bench, speeds=speeds, depths=np.full(count, depth_mm), hold_s=hold_s, dwell_s=dwell_s, sample_every=STEPS_EACH
    )


def cycles_of(case: Case) -> tuple[Bench, list[IndentationCycle]]:
    """The recordings of a case."""
    rng = np.random.default_rng([SEED, 77])
    secrets = [draw_secret(np.random.default_rng(SEED), name) for name in case.causes]
    bench = bench_of(case.trials, rng)
    hidden = Hidden({name: numbers for secret in secrets for name, numbers in secret.causes.items()})
    return bench, recorded(bench, hidden, rng)


def write_tables(folder: Path, cycles: Sequence[IndentationCycle]) -> None:
    """A folder a trial, with a file each of force, axis and marker."""
    for number, cycle in enumerate(cycles):
        place = folder / f"trial_{number:03d}"
        place.mkdir(parents=True)
        streams: Mapping[str, tuple[Array, Mapping[str, Array]]] = {
            "force": (cycle.time_s, {"force_N": cycle.force_n}),
            "axis": (cycle.axis_time_s, {"position_mm": cycle.axis_mm}),
            "marker": (cycle.frame_time_s, dict(zip(("x_mm", "y_mm", "z_mm"), cycle.marker_mm.T, strict=True))),
        }
        for stream, (time_s, columns) in streams.items():
            arrow_csv.write_csv(pa.table({"time_s": time_s, **columns}), place / f"{stream}.csv")


def diagnosed(folder: Path, scratch: Path) -> Took:
    """What the command takes and says, the bytecode of its modules kept as on any machine but this run's first."""
    file, out = scratch / "mapping.toml", scratch / f"{folder.name}.json"
    file.write_text(mapping())
    env = {**os.environ, "PYTHONPYCACHEPREFIX": str(scratch / "code"), "OPENBLAS_NUM_THREADS": "1"}
    env.pop("PYTHONDONTWRITEBYTECODE", None)
    rig, pictures = Path(sys.executable).with_name("rig"), scratch / f"{folder.name}_pictures"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [str(part) for part in (rig, "diagnose", folder, "--mapping", file, "--out", pictures, "--json", out)]
    run(command, stdout=DEVNULL, stderr=DEVNULL, env=env, check=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    said = json.loads(out.read_text())
    named = tuple(one["effects"][0] for one in said["findings"] if not one["provisional"])
    return Took(used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime, used.ru_maxrss / 1024, named)


def rival(bench: Bench, cycles: list[IndentationCycle]) -> Took:
    """All causes fitted at once by scipy's trust-region method, on the engine's own grid and from its first guess."""
    began_s = time.process_time()
    problem = IndentationProblem(observe(session_of(bench, cycles)))
    causes = [cause for cause in testable(problem) if not cause.beside]
    pars = [*problem.base, *{par.name: par for cause in causes for par in cause.pars}.values()]
    first = {par.name: par.null for par in pars} | dict(problem.start())
    scales = np.array([1.0 if par.log else par.scale for par in pars])
    low, start, high = (
        np.array([to_internal(par, value) for par, value in zip(pars, values, strict=True)])
        for values in ([p.low for p in pars], [first[p.name] for p in pars], [p.high for p in pars])
    )
    # A cause is off its null by a thousandth, or its shape would have no slope.
    amplitudes = {par.name for cause in causes for par in cause.amplitudes}
    start = start + 1e-3 * scales * [par.name in amplitudes for par in pars]

    def errors(at: Array) -> Array:
        values = {par.name: from_internal(par, float(x)) for par, x in zip(pars, at, strict=True)}
        seen = zip(problem.channels, problem.predict({**first, **values}), NOISE, strict=True)
        return np.concatenate([(channel.observed - predicted) / noise for channel, predicted, noise in seen])

    found = least_squares(
        errors, np.clip(start, low + 1e-9, high - 1e-9), bounds=(low, high), x_scale=scales, max_nfev=MOST_EVALUATIONS
    )
    slopes = np.asarray(found.jac, float)
    covariance = np.linalg.pinv(slopes.T @ slopes) * 2 * found.cost / len(found.fun)
    reach = dict(zip((par.name for par in pars), SURE * np.sqrt(np.diag(covariance)), strict=True))
    ends = {par.name: from_internal(par, float(x)) for par, x in zip(pars, found.x, strict=True)}
    named = tuple(cause.name for cause in causes if any(is_clear(p, ends[p.name], reach) for p in cause.amplitudes))
    most_MB = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return Took(time.process_time() - began_s, most_MB, tuple(dict.fromkeys(named)))


def is_clear(par: Par, value: float, reach: Mapping[str, float]) -> bool:
    """Whether a size is no chance of the rival's own error, and large enough to matter."""
    return abs(value - par.null) > max(par.least, reach[par.name])


def loop_ms() -> float:
    """A million exponentials, the fastest of ten times [ms]: 5 on an idle core of the machine this was written on."""
    numbers, took_s = np.linspace(0, 1, 10_000), []
    for _ in range(10):
        began_s = time.process_time()
        for _ in range(100):
            np.exp(numbers)
        took_s.append(time.process_time() - began_s)
    return 1e3 * min(took_s)


def missed(took: Mapping[str, Took]) -> list[str]:
    """Goals that were not met, a line each."""
    found = [
        f"{name}: {took[name].cpu_s:.1f} s of processor time, at most {case.goal_s:g} s were asked for"
        for name, case in CASES.items()
        if name in took and case.goal_s and took[name].cpu_s > case.goal_s
    ]
    if {"one", "hundred"} <= took.keys() and took["hundred"].cpu_s > MOST_TIMES * took["one"].cpu_s:
        times = took["hundred"].cpu_s / took["one"].cpu_s
        found.append(f"hundred: {times:.1f} times the fifteen, at most {MOST_TIMES:g} times were asked for")
    wrong = [name for name in CASES if name in took and set(took[name].named) != set(CASES[name].causes)]
    return [*found, *(f"{name}: {', '.join(took[name].named) or 'nothing'} was named" for name in wrong)]


def summary(took: Mapping[str, Took], busy_ms: float) -> str:
    """All figures as one JSON object."""
    ratio = {"hundred_to_one": took["hundred"].cpu_s / took["one"].cpu_s} if {"one", "hundred"} <= took.keys() else {}
    figures = {
        name: {"cpu_s": round(one.cpu_s, 2), "most_MB": round(one.most_MB), "named": one.named}
        for name, one in took.items()
    }
    return json.dumps({**figures, **ratio, "loop_ms": round(busy_ms, 2), "met": not missed(took)})


def measured(names: Sequence[str], scratch: Path) -> dict[str, Took]:
    """Each case, and the rival at the first; four trials of that go before, so that bytecode is there."""
    took = {}
    for number, name in enumerate(names):
        bench, cycles = cycles_of(CASES[name])
        if number == 0:
            write_tables(scratch / "first", cycles[:4])
            diagnosed(scratch / "first", scratch)
        write_tables(scratch / name, cycles)
        took[name] = diagnosed(scratch / name, scratch)
        print(f"{name}: {CASES[name].trials} trials, {took[name]}", flush=True)
        if name == "one":
            took["rival"] = rival(bench, cycles)
            print(f"rival: {CASES[name].trials} trials, {took['rival']}", flush=True)
    return took


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures and prints; 1 where a goal was missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES), help="these sessions and no others")
    names = parser.parse_args(arguments).only
    with TemporaryDirectory() as scratch:
        took = measured(names, Path(scratch))
    for line in missed(took):
        print(f"missed: {line}")
    print(summary(took, loop_ms()))
    return 1 if missed(took) else 0


if __name__ == "__main__":
    sys.exit(main())
