"""The reference of a bench's run played in the simulation by the force law and by each alternative, judged alike."""

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from controller.experiments.comparison import compared_run, jumps
from controller.law import force_profile
from controller.law.loop_response import Rates
from controller.law.synthesis import LARGEST_STIFFNESS, LEAST_STIFFNESS
from controller.loop.steps import Program, TrackForce
from controller.operation import Operation
from controller.simulated.alternatives import alternative_law
from controller.simulated.alternatives.alternative_laws import Alternative, alternatives, tuning_for
from controller.simulated.alternatives.alternative_tuning import Tuning
from controller.simulated.bench import SENSING, Column, SimulatedBench, follow, follow_law, limb_of
from rig.errors import RigError
from rig.results.tracking import AlternativeRun, Jump
from rig.tissue.model import Model

LAW = "force law"
FUNCTIONS = alternative_law.correct, alternative_law.increment
WRONG = LEAST_STIFFNESS, LARGEST_STIFFNESS


class BenchRun(NamedTuple):
    """What a bench was asked for on one subject; ``breathing`` in mm and Hz."""

    subject: str
    tissue: str
    model: Model
    program: Program
    breathing: tuple[float, float] | None = None


def simulated_runs(
    operation: Operation, asked: Sequence[BenchRun], rates: Rates, done: int, refused: dict[str, str]
) -> Iterator[AlternativeRun]:
    """All of it by each law; ``operation`` has ``done`` so much before, ``refused`` is told whose could not be."""
    if not asked:
        return
    operation.step("tuning one constant for all", done)
    tissues = {one.tissue: tracks(one.program)[0] for one in asked}
    for_all = tuning_for(list(tissues.values()), rates, "constant")
    for number, one in enumerate(asked):
        operation.step(f"simulating each law on {one.subject}", done + number)
        operation.say(operation.progress.message)
        moves = one.breathing or (0.0, 1.0)
        try:
            yield from alternative_runs(one.subject, one.program, one.model, moves, rates, for_all)
        except RigError as error:
            refused[one.subject] = str(error)
            operation.say(f"{one.subject} is not simulated by all laws: {error}")


def tracks(program: Program) -> list[TrackForce]:
    """The steps of a program in which a law follows force."""
    return [step for step in program.steps if isinstance(step, TrackForce)]


def alternative_runs(
    subject: str, program: Program, model: Model, breathing: tuple[float, float], rates: Rates, for_all: Tuning
) -> Iterator[AlternativeRun]:
    """A row for each law on one subject, whose tissue is as ``model`` says; ``breathing`` in mm and Hz."""
    steps, sensing = tracks(program), SENSING._replace(every_cycles=rates.every_cycles)
    for name, law in chain([(LAW, None)], alternatives(steps[0], rates, for_all)):
        found = {
            stiffness: _jumps(steps, law, SimulatedBench(limb_of(model, stiffness, *breathing), sensing=sensing), rates)
            for stiffness in (1.0, *WRONG)
        }
        wrong = [jump for stiffness in WRONG for jump in found[stiffness]]
        worst, of_wrong = (compared_run(subject, one).worst for one in (found[1.0], wrong))
        yield AlternativeRun(subject=subject, law=name, worst=worst, worst_of_wrong=of_wrong)


def _jumps(
    steps: Sequence[TrackForce], law: Alternative | None, bench: SimulatedBench, rates: Rates
) -> tuple[Jump, ...]:
    """Of the force law where no other is given."""
    asked_N = _asked(steps, law.preview_s if law else steps[0].preview_s, rates.cycle_s)
    if law is None:
        trace = follow(steps[0], asked_N, bench, rates.cycle_s)
    else:
        memory = alternative_law.begin(law.table, law.settings.inverse, 0.0)
        trace = follow_law(FUNCTIONS, memory, law.table, law.settings, asked_N, bench, rates.cycle_s)
    return jumps(trace.time_s, _asked(steps, 0.0, rates.cycle_s), trace.sensed_N, trace.mode)


def _asked(steps: Sequence[TrackForce], preview_s: float, dt_s: float) -> Column:
    """What a law is asked for in each cycle of all steps, one after the other."""
    return np.concatenate([
        force_profile.along(force_profile.preview(step.given, preview_s), np.arange(0.0, step.given.duration_s, dt_s))
        for step in steps
    ])  # fmt: skip
