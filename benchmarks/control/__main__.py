"""Plays every law on every case and says what the force law gains; the last line is one JSON object.

python -m benchmarks.control [--quick] [--seeds N] [--json FILE] [--pictures FOLDER] [--processes N]
python -m benchmarks.control --wire FILE [--minutes M] [--seeds N]
"""

import argparse
import math
import os
import sys
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path

from benchmarks.control import pictures
from benchmarks.control.goals import DB, DEG, GOALS, JUMPS, LOW_JUMPS, PEAK, ROUNDED
from benchmarks.control.laws import ABLATIONS, CONSTANTS, LAW, LEAVES, OTHERS, TRIED, makers, track_step
from benchmarks.control.plants import FAST, PLANT, SLOW, SUBJECTS, Plant, model_of, wiring_of
from benchmarks.control.runs import jobs_of, play_all
from benchmarks.control.scores import (
    BEST,
    Headline,
    Mean,
    Score,
    best_constant,
    gain_of,
    headline,
    limb_gains,
    mean_of,
    wrong_models,
)
from controller.experiments import tracking
from controller.law.axis_response import rates_of, response_of
from controller.law.loop_response import Constants
from controller.law.synthesis import SPARE_S, over_span
from rig.config.table import Table

SEEDS, QUICK_SEEDS = 4, 1
QUICK_LAWS = (LAW, *CONSTANTS, "one constant for all")
# Axes, sensors and delays other than the bench's own, and what is asked of them.
PLANTS = {
    "axis 15 Hz": Plant(15.0), "axis 60 Hz": Plant(60.0), "sensor 100 Hz": Plant(sensing=SLOW),
    **{f"{more} ms later": Plant(sensing=FAST, extra_cycles=more) for more in (1, 2, 5, 12)},
}  # fmt: skip
PLANT_LAWS = LAW, "constant", *OTHERS


class Cell(Table):
    """One law on one case."""

    law: str
    case: str
    plant: str = "bench"
    mean: Mean | None = None
    refused: str = ""


class Result(Table):
    """All that was measured."""

    date: str
    seconds: float
    seeds: int
    runs: int
    headline: Headline
    against: dict[str, dict[str, tuple[float, float, float, float]]]
    cells: tuple[Cell, ...]


def main() -> None:
    """Plays, prints and writes; exit code 1 where a promise is not kept."""
    asked = _arguments()
    sys.exit(1 if (_wire(asked) if asked.wire else _simulation(asked)) else 0)


def _wire(asked: argparse.Namespace) -> list[str]:
    from benchmarks.control import wire, wire_margins, wire_report  # noqa: PLC0415 - loads the bench

    played = wire.measure(asked.wire, asked.minutes, asked.seeds or QUICK_SEEDS)
    return [*wire_report.show(played), *wire_margins.show(wire_margins.on_bench())]


def _simulation(asked: argparse.Namespace) -> list[str]:
    """Prints what was found, the headline last; returns the promises that are not kept."""
    began = time.monotonic()
    names = asked.laws or (QUICK_LAWS if asked.quick else tuple(makers()))
    seeds = range(1, 1 + (asked.seeds or (QUICK_SEEDS if asked.quick else SEEDS)))
    done = play_all(jobs_of(names, "quick" if asked.quick else "every", seeds), asked.processes)
    scores = [score for one in done for score in one.scores]
    shown = table(scores, names)
    if not asked.quick:
        shown += other_plants(asked.processes)
        touched = [score for one in play_all(jobs_of([LEAVES], "touch", (1,)), 1) for score in one.scores]
        shown += table(touched, [LEAVES], "no law")
    found = headline(scores, worst_margins())
    compared = [*scores, *best_constant(scores)]
    others = [BEST, *(name for name in names if name not in {LAW, *ABLATIONS, *TRIED})]
    against = {other: _against(compared, other) for other in others}
    seconds = time.monotonic() - began
    result = Result(
        date=time.strftime("%Y-%m-%d"), seconds=round(seconds, 1), seeds=len(seeds), runs=len(scores), headline=found,
        against=against, cells=tuple(shown),
    )  # fmt: skip
    _print(result, names)
    if asked.json:
        asked.json.write_text(result.model_dump_json(indent=1) + "\n")
    if asked.pictures:
        pictures.draw(result.cells, asked.pictures)
    print(found.model_dump_json())
    return missed(found)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.control", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one seed, tuned constants only, the headline's tests")
    parser.add_argument("--laws", nargs="*", choices=list(makers()), help="these alone; law and constants first")
    parser.add_argument("--seeds", type=int, default=0, help=f"seeds of noise for each subject; else {SEEDS}, or 1")
    parser.add_argument("--json", type=Path, help="all numbers")
    parser.add_argument("--pictures", type=Path, help="folder for the pictures")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="that play at the same time")
    parser.add_argument("--wire", type=Path, help="instead, law and constant on the mock bench; goes on with this file")
    parser.add_argument("--minutes", type=float, default=math.inf, help="with --wire: nothing begins after these")
    return parser.parse_args()


def other_plants(processes: int) -> list[Cell]:
    """The law and its alternatives where axis, sensor or delay are others, each identified and tuned anew."""
    wanted = [job for plant in PLANTS.values() for job in jobs_of(PLANT_LAWS, "plants", (1,), plant)]
    done, found = list(play_all(wanted, processes)), []
    for (plant_name, plant), law in product(PLANTS.items(), PLANT_LAWS):
        mine = [one for one in done if (one.job.plant, one.job.law) == (plant, law)]
        refused = next((one.refused for one in mine if one.refused), "")
        scores = [score for one in mine for score in one.scores]
        found += [Cell(law=law, case="all", plant=plant_name, refused=refused)] if refused else []
        found += table(scores, [law], plant_name)
    return found


def table(scores: Sequence[Score], names: Sequence[str], plant: str = "bench") -> list[Cell]:
    """A mean for each law and case."""
    every_case = dict.fromkeys(score.case for score in scores)
    return [
        Cell(law=name, case=case, plant=plant, mean=mean_of(scores, name, [case]))
        for case in every_case
        for name in names
    ]


def worst_margins() -> tuple[float, float]:
    """The smallest phase margin [deg] and gain margin [dB] of all subjects, x0.5 to x2, the spare delay used up."""
    found = []
    for subject in SUBJECTS:
        step, wiring = track_step(subject, PLANT), wiring_of(PLANT)
        axis, rates = response_of(wiring), rates_of(wiring)
        law = Constants(step.crossover_rad_s, step.lead_s, step.drift_rad_s)
        span = tracking.loop_for(model_of(subject), wiring).span
        margins = over_span(axis._replace(delay_s=axis.delay_s + SPARE_S), rates, law, span)
        found.append((float(margins.phase_deg.min()), 20 * math.log10(float(margins.gain.min()))))
    return min(deg for deg, _ in found), min(dB for _, dB in found)


def missed(found: Headline) -> list[str]:
    """Promises that are not kept, one sentence each."""
    gains = [(f"limb_2Hz_gain at {at} N", found.limb_2Hz_gain[at], least) for at, least in GOALS.items()]
    least = [
        *gains, ("low_jump_settling_gain", found.low_jump_settling_gain, LOW_JUMPS),
        ("jump_settling_gain", found.jump_settling_gain, JUMPS),
        ("phase margin [deg]", found.margins_deg_dB[0], DEG - ROUNDED),
        ("gain margin [dB]", found.margins_deg_dB[1], DB - ROUNDED),
    ]  # fmt: skip
    sentences = [f"{name} is {value:g}, promised {bound:g} or more" for name, value, bound in least if value < bound]
    if found.contact_peak > PEAK:
        sentences.append(f"contact_peak is {found.contact_peak:g}, promised {PEAK:g} or less")
    return sentences


def _against(scores: Sequence[Score], other: str) -> dict[str, tuple[float, float, float, float]]:
    """Gains with their intervals, and of the worst subjects."""
    found = {f"limb 2 Hz, {force_N} N": gain for force_N, gain in limb_gains(scores, other).items()}
    found |= {what: gain_of(scores, other, wrong_models(what)) for what in ("low jumps", "jumps")}
    return {what: (round(one.value, 2), round(one.low, 2), round(one.high, 2), round(one.of_worst, 2))
            for what, one in found.items()}  # fmt: skip


def _print(result: Result, names: Sequence[str]) -> None:
    laws_shown = [name for name in (LAW, *CONSTANTS, *OTHERS, *ABLATIONS, *TRIED, LEAVES) if name in (*names, LEAVES)]
    print("mean of five subjects (worst); errors in mN, jumps in ms, contact and bone over what was asked")
    for name in laws_shown:
        print(f"  {laws_shown.index(name)}: {name}")
    cells = {(cell.plant, cell.case, cell.law): cell for cell in result.cells}
    for plant, case in dict.fromkeys((cell.plant, cell.case) for cell in result.cells):
        shown = [_shown(cells.get((plant, case, name))) for name in laws_shown]
        print(f"{plant:14} {case:24}", " ".join(shown))
    for other, gains in result.against.items():
        print(f"against {other}:")
        for what, (value, low, high, of_worst) in gains.items():
            print(f"  {what:18} {value:6.2f}x ({low:.2f} to {high:.2f}; worst subjects {of_worst:.2f})")
    print(f"{result.runs} runs of {result.seeds} seeds in {result.seconds:g} s")
    for sentence in missed(result.headline):
        print("NOT KEPT:", sentence)


def _shown(cell: Cell | None) -> str:
    if cell is None:
        return f"{'-':>14}"
    if cell.mean is None:
        return f"refused: {cell.refused}"
    share = cell.case.startswith(("contact", "soft to bone"))
    factor, digits = (1, 2) if share else (1000, 0)
    text = f"{factor * cell.mean.value:.{digits}f} ({factor * cell.mean.worst:.{digits}f})"
    return f"{text:>14}"


if __name__ == "__main__":
    main()
