"""A campaign: how a seed becomes a record, and what its records are asked."""

import time
from collections.abc import Callable
from typing import NamedTuple

from benchmarks.campaigns.case import AnswerFunction, Case, Plant, Record
from benchmarks.campaigns.counts import Question


class Campaign(NamedTuple):
    """``record(seed, answer)`` makes a session, has it answered and writes both down."""

    record: Callable[[int, AnswerFunction], Record]
    questions: tuple[Question, ...]
    asks_confidence: bool = False


def judged(case: Case, answer: AnswerFunction, plant: Plant | None = None) -> Record:
    """The case with its answer, and the processor time of both."""
    begin_s = time.process_time()
    found = answer(case)
    spent_s = round(time.process_time() - begin_s, 1)
    return Record(case.seed, case.generator, case.truth, found, plant, spent_s)
