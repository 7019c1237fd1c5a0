"""One call from observations to a diagnosis."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rig.diagnosis.answers import Diagnosis, answer, error_sources, intervals, limits, without_sizes
from rig.diagnosis.design import next_experiment
from rig.diagnosis.estimates import NextExperiment
from rig.diagnosis.families import on_any_law, with_families
from rig.diagnosis.fit import first_fit, held_values, refreshed
from rig.diagnosis.floor import error_budget
from rig.diagnosis.indentation import IndentationProblem, Simulation, library
from rig.diagnosis.lack_of_fit import assess_lack_of_fit
from rig.diagnosis.observations import NOTICEABLE, Observations, observe, rise_N, sound_trials
from rig.diagnosis.other_forms import with_best_form
from rig.diagnosis.problem import InverseProblem
from rig.diagnosis.search import search
from rig.diagnosis.verdict import summary, verdict_of
from rig.errors import DataError
from rig.progress import Progress, silent
from rig.trials.cycles import in_cycles
from rig.trials.findings import Finding
from rig.trials.streams import sample_noise
from rig.trials.trial import TrialSet

FEWEST_RECORDINGS = 4  # three without the one left out: the fewest whose scatter about a mean is more than one number


def diagnose(
    data: Observations, simulation: Simulation = "index", seed: int = 1, progress: Progress = silent
) -> Diagnosis:
    """What the simulation gets wrong on these recordings; never raises on data that merely say nothing."""
    problem = IndentationProblem(data, simulation)
    fault = unusable(data)
    if fault is not None:
        return cannot(simulation, data.name, data.drive.recordings, fault, data.findings)
    result = judge(problem, data.name, data.findings, seed, progress)
    return replace(result, next_experiment=next_experiment(result))


def judge(
    problem: InverseProblem, name: str, quality: tuple[Finding, ...], seed: int = 1, progress: Progress = silent
) -> Diagnosis:
    """The same for any system under criticism."""
    rng = np.random.default_rng(seed)
    progress("fit of the simulation as it is", 0.02)
    before = refreshed(first_fit(problem))
    found_before = assess_lack_of_fit(before, rng)
    search_result = with_families(with_best_form(search(problem, before, rng, progress)))
    progress("what is left", 0.95)
    found_after = assess_lack_of_fit(search_result.after, rng) if search_result.named else found_before
    budget = error_budget(before, search_result.after) if isinstance(problem, IndentationProblem) else None
    verdict, depends = verdict_of(search_result, found_after, budget)
    after, is_explained = search_result.after, verdict == "explained"
    sources = error_sources(after, is_left=verdict == "unexplained")
    named = [on_any_law(one, after) if is_explained else one for one in search_result.named]
    answers = [answer(one, after, not (is_explained and one.stands), sources) for one in named]
    findings = tuple(sorted(answers, key=lambda found: -found.evidence_nats))
    visible, reasons = limits(problem, search_result, budget)
    progress("done", 1.0)
    held = held_values(problem, after.effects)
    result = Diagnosis(
        session=name, simulation=problem.title, recordings=problem.recordings, verdict=verdict,
        statement=summary(verdict, findings, depends, problem.title, budget), findings=findings, depends_on=depends,
        lack_of_fit_p=min(found_after.p_value, found_after.between_p), detectable=visible, not_testable=reasons,
        next_experiment=None, quality=quality,
        base=intervals(after, [par for par in problem.base if par.name not in held], sources),
        search=search_result, before=found_before, after=found_after, budget=budget,
    )  # fmt: skip
    return without_sizes(result)


class Flaw(NamedTuple):
    """Why nothing can be judged, and what to do about it."""

    reason: str
    remedy: str


RECORD = "record at least 6 cycles at three or more speeds, for example with examples/diagnosis.toml"


# Milliseconds taken for seconds make 1 Hz of 1 kHz; micrometres taken for millimetres make metres of any indentation.
SLOWEST_HZ, LONGEST_MM = 2.0, 300.0
# Of tissue and of anything soft in its place, over the whole travel.
STIFFEST_N_MM, SOFTEST_N_MM = 100.0, 1e-4


def _unit_fault(data: Observations) -> Flaw | None:
    """What looks like another unit than s, N or mm."""
    force_N, travel_mm = float(np.ptp(data.force_N)), float(np.ptp(data.drive.position_mm))
    if data.rate_Hz < SLOWEST_HZ:
        return Flaw(
            f"force was sampled {data.rate_Hz:.3g} times a second by its time stamps (limit {SLOWEST_HZ:g})",
            "give time_s in seconds (divide milliseconds by 1000), or sample faster",
        )
    if travel_mm > LONGEST_MM:
        return Flaw(f"the axis travels {travel_mm:.4g} mm (limit {LONGEST_MM:g} mm)", "give position_mm in mm")
    if force_N and travel_mm and not SOFTEST_N_MM < force_N / travel_mm < STIFFEST_N_MM:
        return Flaw(
            f"force changes by {force_N:.4g} N over {travel_mm:.4g} mm of travel (limits {SOFTEST_N_MM:g} to "
            f"{STIFFEST_N_MM:g} N/mm), which no tissue does",
            "give force_N in N and position_mm in mm",
        )
    return None


def unusable(data: Observations) -> Flaw | None:
    """Why nothing can be tested with these data; None where something can."""
    force, position = data.force_N, data.drive.position_mm
    odd = _unit_fault(data)
    if odd is not None:
        return odd
    if np.ptp(force) == 0 or np.ptp(position) == 0:
        still = "force" if np.ptp(force) == 0 else "position"
        return Flaw(f"the {still} never changes, so the recordings carry no experiment", f"connect the {still} sensor")
    noise = sample_noise(force)
    rise = rise_N(position, force)
    if rise < -NOTICEABLE * noise:
        return Flaw(
            "force falls as the tip goes in, so force or position has the wrong sign",
            "correct `positive` of force or position in the mapping (force.compression in rig.toml for a capture) "
            "and diagnose again",
        )
    if rise < NOTICEABLE * noise:
        return Flaw(f"the force rises by {rise:.3g} N from above to below, no more than its noise: no contact", RECORD)
    if data.drive.recordings < FEWEST_RECORDINGS:
        count = data.drive.recordings
        return Flaw(
            f"{count} recording{'s' * (count > 1)} of one cycle: a cause is judged on cycles left out, which takes "
            f"at least {FEWEST_RECORDINGS}",
            RECORD,
        )
    return None


def cannot(simulation: Simulation, name: str, recordings: int, fault: Flaw, quality: tuple[Finding, ...]) -> Diagnosis:
    """The answer where nothing can be judged: nothing is explained, no cause named, and each listed with the reason."""
    return Diagnosis(
        session=name, simulation=simulation, recordings=recordings, verdict="not judged",
        statement=f"Nothing could be judged: {fault.reason}. This says neither that the simulation is right nor wrong.",
        findings=(), depends_on=(), lack_of_fit_p=None, detectable={},
        not_testable={effect.name: fault.reason for effect in library(simulation)},
        next_experiment=NextExperiment(fault.remedy), quality=quality,
    )  # fmt: skip


def judged_trials(session: TrialSet) -> TrialSet:
    """What of a session is judged: its recordings, or where they are few their cycles."""
    return in_cycles(session) if len(sound_trials(session)[0]) < FEWEST_RECORDINGS else session


def diagnose_session(session: TrialSet, simulation: Simulation = "index", progress: Progress = silent) -> Diagnosis:
    """A session as it was read; one without a usable recording gets an answer too."""
    try:
        data = observe(judged_trials(session))
    except DataError as error:
        reason = str(error).removeprefix(f"{session.name}: ").removesuffix("; run `rig verify` on it")
        return cannot(simulation, session.name, 0, Flaw(reason, f"mend these files, or {RECORD}"), session.findings)
    return diagnose(data, simulation, progress=progress)
