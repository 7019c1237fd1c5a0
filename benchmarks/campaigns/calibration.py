"""Calibration: confidence against frequency, intervals, and whether the sizes stated are found in four of five."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.campaigns import forms, hidden
from benchmarks.campaigns import questions as ask
from benchmarks.campaigns.campaign import Campaign, judged
from benchmarks.campaigns.case import AnswerFunction, Record
from benchmarks.campaigns.counts import Goal, Question
from benchmarks.campaigns.operators import OPERATORS
from benchmarks.campaigns.planted import plant_in
from benchmarks.forms.draw import ROTATION

# In the order of the seeds: sessions of two generators as they are, and a clean one planted at exactly the size stated.
TURNS = 3


def record(seed: int, answer: AnswerFunction) -> Record:
    """A session of the generators, or one with a plant at the size that was stated for it."""
    turn, number = seed % TURNS, seed // TURNS
    if turn < TURNS - 1:
        return judged(replace((forms, hidden)[turn].case_of(number), seed=seed), answer)
    return record_at_stated(seed, number, answer)


def record_at_stated(seed: int, number: int, answer: AnswerFunction) -> Record:
    """A clean session judged, then planted with one of the causes whose smallest size was stated, and judged again."""
    case = replace(forms.case_of(number * len(ROTATION) + ROTATION.index("clean")), seed=seed)
    before = answer(replace(case, asks_sizes=True))
    stated = sorted(cause for cause in before.smallest if cause in OPERATORS and OPERATORS[cause].parameter)
    if not stated:
        return judged(case, lambda _: before)
    cause = str(np.random.default_rng([number, 17]).choice(stated))
    planted, plant = plant_in(case, before, cause, 1.0)
    return judged(planted, answer, plant)


def finds_at_stated(one: Record) -> Iterator[bool]:
    """Of plants at the size stated: whether the cause is in a set."""
    if one.plant and one.plant.ratio:
        yield one.plant.cause in one.answer.all_names


CALIBRATION = Campaign(
    record,
    (
        Question("known sizes inside their 95 % intervals", Goal(0.9, 0.98), ask.covers),
        Question("found, planted at the size stated", Goal(0.7, 0.9), finds_at_stated),
        Question("sessions with a certain wrong name", None, ask.has_false_name),
    ),
    asks_confidence=True,
)
