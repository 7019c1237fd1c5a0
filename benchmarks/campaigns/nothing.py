"""Nothing planted: real recordings as they are, in another order, and each of a few cut in two."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from benchmarks.campaigns import questions as ask
from benchmarks.campaigns.campaign import Campaign, judged
from benchmarks.campaigns.case import AnswerFunction, Case, Record, Truth
from benchmarks.campaigns.counts import Goal, Question
from benchmarks.campaigns.measured import FEWEST, PARTS, SETS, MeasuredSet, in_a_row, session_of
from rig.trials.trial import Trial, TrialSet

BETWEEN = frozenset({"preconditioning", "zero_drift", "temperature"})  # what order and labels tell of
JUDGED = (*SETS, *PARTS)  # names of sets that the simulation misses are never certain
HALVED = 3  # recordings cut in two: six are enough to be judged


def as_they_are(trials: list[Trial], rng: np.random.Generator) -> list[Trial]:
    """Some of the recordings, in their order."""
    count = int(rng.integers(FEWEST, len(trials) + 1))
    return [trials[k] for k in sorted(rng.choice(len(trials), count, replace=False))]


def permuted(trials: list[Trial], rng: np.random.Generator) -> list[Trial]:
    """All of them in another order, the speed stated for each that of another."""
    order, labels = rng.permutation(len(trials)), rng.permutation(len(trials))
    pairs = zip(order, labels, strict=True)
    return [replace(trials[k], speed_mm_s=trials[label].speed_mm_s) for k, label in pairs]


def halved(trials: list[Trial], rng: np.random.Generator) -> list[Trial]:
    """Each of a few in two, every other sample of force in one and the rest in the other."""
    chosen = [trials[k] for k in rng.choice(len(trials), HALVED, replace=False)]
    return [_half(trial, first) for trial in chosen for first in (0, 1)]


def _half(trial: Trial, first: int) -> Trial:
    temperature_C = None if trial.temperature_C is None else trial.temperature_C[first::2]
    return replace(
        trial, name=f"{trial.name}, half {first + 1}", force_s=trial.force_s[first::2],
        force_N=trial.force_N[first::2], temperature_C=temperature_C,
    )  # fmt: skip


Change = Callable[[list[Trial], np.random.Generator], list[Trial]]
CHANGES: Mapping[str, Change] = {"as they are": as_they_are, "labels permuted": permuted, "halves": halved}


def case_of(seed: int) -> Case:
    """A set and what is done to it; as many seeds in a row as there are sets hold every set."""
    rng = np.random.default_rng([seed, 13])
    chosen: MeasuredSet = JUDGED[seed % len(JUDGED)]
    how = list(CHANGES)[seed // len(JUDGED) % len(CHANGES)]
    known = chosen.known if how == "as they are" else chosen.known - BETWEEN

    def make() -> tuple[TrialSet, float | None]:
        session = session_of(chosen)
        return replace(session, trials=in_a_row(CHANGES[how](list(session.trials), rng))), None

    return Case(seed, chosen.name, Truth((known,), told=f"{how}: {', '.join(sorted(known))} at most"), make)


def record(seed: int, answer: AnswerFunction) -> Record:
    """One session."""
    return judged(case_of(seed), answer)


NOTHING = Campaign(
    record,
    (
        Question("sessions with a certain name not known to be true", Goal(high=0.0), ask.has_false_name),
        Question("sessions with such a provisional name", None, ask.has_false_hint),
    ),
)
