"""Planted in real data: operators on measured recordings, at sizes above and below the one stated for them."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from benchmarks.campaigns import questions as ask
from benchmarks.campaigns.campaign import Campaign, judged
from benchmarks.campaigns.case import Answer, AnswerFunction, Case, Plant, Record, Truth
from benchmarks.campaigns.counts import Goal, Question
from benchmarks.campaigns.measured import PARTS, SETS, MeasuredSet, session_of
from benchmarks.campaigns.operators import OPERATORS, plant
from rig.trials.trial import TrialSet

# Two in three above the size stated, by enough that one in five missed there by chance is none; one in three below.
ABOVE, BELOW = (1.5, 4.0), (0.2, 0.7)
# A set that the simulation misses has no size stated: its plants show names only, those of the parts sizes too.
IN_TURN = tuple(one for k, whole in enumerate(SETS) for one in (whole, PARTS[k % len(PARTS)]))


def case_of(chosen: MeasuredSet) -> Case:
    """A set as it was measured."""
    truth = Truth((chosen.known,), told="what was measured")
    return Case(0, chosen.name, truth, lambda: (session_of(chosen), None), asks_sizes=True)


@cache
def answer_as_measured(chosen: MeasuredSet, answer: AnswerFunction) -> Answer:
    """The answer to a set with nothing planted, once for all seeds."""
    return answer(case_of(chosen))


def plant_in(case: Case, before: Answer, cause: str, ratio: float) -> tuple[Case, Plant]:
    """The case with a cause at ``ratio`` of the size stated for it, or of a usual one where none was."""
    operator, stated = OPERATORS[cause], before.smallest.get(cause)
    size = ratio * (stated or operator.usual)
    truth = Truth(
        (operator.also | {cause}, *case.truth.names),
        sizes={operator.parameter: size} if operator.parameter else {},
        told=f"{cause} of {size:.3g}, {ratio:.2g} of the size stated" if stated else f"{cause} of {size:.3g}",
    )

    def make() -> tuple[TrialSet, float | None]:
        session, noise_N = case.made
        return plant(session, cause, size), noise_N

    known = stated if operator.parameter else None
    return replace(case, truth=truth, make=make, asks_sizes=False), Plant(cause, size, known, before.all_names)


def choose(rng: np.random.Generator, before: Answer) -> str:
    """A cause not named before; twice as often one for which a size was stated."""
    free = [cause for cause in OPERATORS if cause not in before.all_names]
    stated = [cause for cause in free if cause in before.smallest]
    return str(rng.choice(stated if stated and rng.random() < 2 / 3 else free))


def record_in(sets: Sequence[MeasuredSet], seed: int, answer: AnswerFunction) -> Record:
    """One plant in one of the sets; as many seeds in a row as there are sets have all of them."""
    rng = np.random.default_rng([seed, 11])
    chosen = sets[seed % len(sets)]
    before = answer_as_measured(chosen, answer)
    ratio = float(rng.uniform(*(ABOVE if rng.random() < 2 / 3 else BELOW)))
    case, planted = plant_in(replace(case_of(chosen), seed=seed), before, choose(rng, before), ratio)
    return judged(case, answer, planted)


def record(seed: int, answer: AnswerFunction) -> Record:
    """One plant in one of the real sets, in turn whole and where sizes are stated."""
    return record_in(IN_TURN, seed, answer)


def _new(one: Record) -> list[frozenset[str]]:
    """Sets of names that were not named before."""
    before = one.plant.before if one.plant else frozenset[str]()
    return [frozenset(found.effects) for found in one.answer.named if not before & set(found.effects)]


def finds_above(one: Record) -> Iterator[bool]:
    """Of plants above the size stated: whether anything is named that was not before."""
    if one.plant and one.plant.ratio and one.plant.ratio >= 1:
        yield bool(_new(one))


def finds_below(one: Record) -> Iterator[bool]:
    """The same of those below."""
    if one.plant and one.plant.ratio and one.plant.ratio < 1:
        yield bool(_new(one))


def holds_planted(one: Record) -> Iterator[bool]:
    """Where anything new is named: whether what was planted is in a set."""
    if one.plant and _new(one):
        yield any(one.truth.names[0] & names for names in _new(one))


def states_size(one: Record) -> Iterator[bool]:
    """Whether a size had been stated for the cause."""
    if one.plant:
        yield one.plant.stated is not None


PLANTED = Campaign(
    record,
    (
        Question("found, planted above the size stated", Goal(low=0.9), finds_above),
        Question("what was planted in the answer, where anything new was", Goal(low=0.95), holds_planted),
        Question("sessions with a certain wrong name", Goal(high=0.01), ask.has_false_name),
        Question("found, planted below the size stated", None, finds_below),
        Question("planted sizes inside their 95 % intervals", None, ask.covers),
        Question("a size had been stated for what was planted", None, states_size),
        Question("sessions with a provisional wrong name", None, ask.has_false_hint),
    ),
)
