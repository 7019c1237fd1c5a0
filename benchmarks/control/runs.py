"""Every run of the comparison, law by law and subject by subject, on as many cores as asked for."""

import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

from benchmarks.control import cases
from benchmarks.control.cases import Case, played_all
from benchmarks.control.laws import makers
from benchmarks.control.plants import PLANT, SUBJECTS, Plant
from benchmarks.control.scores import Score
from controller.experiments.tracking import CONTACT_N
from rig.errors import UsageError


class Job(NamedTuple):
    """One law on one subject and plant: a process makes the law once and plays all cases with it."""

    law: str
    subject: str
    plant: Plant
    asked: str
    seeds: tuple[int, ...]


class Done(NamedTuple):
    """What came of a job: its numbers, or why no law was made."""

    job: Job
    scores: tuple[Score, ...]
    refused: str = ""


def jobs_of(names: Sequence[str], asked: str, seeds: Sequence[int], plant: Plant = PLANT) -> list[Job]:
    """A job for each of these laws and every subject; ``asked`` is a key of `cases_of`."""
    return [Job(name, subject, plant, asked, tuple(seeds)) for name in names for subject in SUBJECTS]


def cases_of(asked: str) -> Sequence[Case]:
    """``every``, those of the headline alone (``quick``), those played on another axis or sensor (``plants``).

    ``touch``: contacts where hardly more is asked for than what says that there is one.
    """
    if asked == "plants":
        limbs = [cases.limb_motion(force_N, 2.0) for force_N in (0.5, 2.0, 10.0)]
        jumps = [cases.stair("low jumps", 0.3, 1.5, 0.3, 1.0, stiffness) for stiffness in cases.WRONG]
        return [*limbs, cases.breathing(10.0), cases.contact(0.0), *jumps]
    if asked == "touch":
        return [cases.contact(speed_mm_s, asked_N=0.501 * CONTACT_N) for speed_mm_s in cases.COMING_MM_S]
    return list(cases.every(quick=asked == "quick"))


def play(job: Job) -> Done:
    """All runs of a job."""
    try:
        law = makers([job.law])[job.law](job.subject, job.plant)
    except UsageError as error:
        return Done(job, (), str(error))
    found = [
        Score(job.law, name, job.subject, seed, value)
        for case in cases_of(job.asked)
        for seed in job.seeds
        for name, value in played_all(case, law, job.subject, seed, job.plant)
    ]
    return Done(job, tuple(found))


def play_all(wanted: Sequence[Job], processes: int) -> Iterator[Done]:
    """As they were asked for. The code that one process compiles is there for the next, on disk."""
    if processes < 2:
        yield from map(play, wanted)
        return
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(play, wanted)
