"""A run of force tracking into a recording, and what it says of the loop."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean

from controller.experiments import tracking
from controller.experiments.capture import new_session, refuse_used
from controller.experiments.recorded import Recorded, metadata, record, refuse_bench
from controller.experiments.references import Reference
from controller.experiments.verdicts import with_quality, with_surface
from controller.loop.steps import Program, TrackForce
from controller.safety.program_limits import refuse_beyond_limits
from controller.supervisor import Supervisor, stop_error
from rig.apart import apart
from rig.channels import LoopSample
from rig.config.quality import QualityLimits
from rig.config.wiring import Wiring
from rig.errors import BadTrial, UsageError
from rig.recording.reader import TRACKING, read_recording
from rig.recording.sessions import SESSION_FILE, TrialInfo, open_session, write_session
from rig.results.tracking import FILE, LoopCount, TrackResult
from rig.tissue.model import Model

MARGIN_S = 60.0  # three times what approach, touches and retraction over 40 mm take


def forces(text: str) -> tuple[float, ...]:
    """``1,2,5`` as forces in N; raises UsageError for anything else."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise UsageError(f"--force {text}: write one force in N, or several with commas, for example 1,2,5") from error
    wrong = [value for value in values if not 0 < value < math.inf]
    if wrong:
        raise UsageError(f"--force {text}: {wrong[0]:g} N is not a force to press with; it must be above 0 and finite")
    return values


def refuse_foreign(folder: Path) -> None:
    """Raises UsageError where a run can be recorded into ``folder`` neither as a new session nor as part of one."""
    if not (folder / SESSION_FILE).exists():
        refuse_used(folder)


def plan(forces_N: Sequence[float], seconds: float, model: Model, wiring: Wiring) -> Program:
    """The program, checked against model and limits before anything is opened."""
    return plan_reference(tracking.levels(forces_N, seconds), model, wiring)


def plan_reference(reference: Reference, model: Model, wiring: Wiring) -> Program:
    """The same for any reference."""
    program = tracking.following(reference, model, wiring)
    refuse_beyond_limits(program, wiring)
    return program


def run(bench: Supervisor, program: Program, folder: Path, model: str) -> TrackResult:
    """Tracks, records into ``folder`` (an existing session or a new one), and reads the result from the recording.

    Raises SafetyStop, with the recording kept, where the run was stopped.
    """
    done = recorded_run(bench, program, folder, model)
    if done.outcome.stopped:
        raise stop_error(done.outcome)
    entry = open_session(folder).trial(done.file.stem)
    found = apart(done.file, evaluate, done, model)
    result = found.model_copy(update={"quality": entry.quality, "reasons": entry.reasons})
    result.write(folder / FILE)
    return result


def recorded_run(bench: Supervisor, program: Program, folder: Path, model: str) -> Recorded:
    """One run into the session in ``folder``, a new one where there is none; listed there however it ended."""
    refuse_bench(bench, program)
    if not (folder / SESSION_FILE).exists():
        new_session(folder, "track", {"name": program.name, "kind": TRACKING}, bench.wiring)
    session = open_session(folder).info.id
    name = _free_name(folder)
    about = {
        "trial": {"kind": TRACKING, "name": program.name},
        "model": {"file": model},
        "protocol": {"kind": TRACKING, "quality": QualityLimits().model_dump(mode="json")},
    }
    longest_s = MARGIN_S + duration_s(program)
    done = record(bench, program, folder / f"{name}.mcap", metadata(bench, session, name, about), longest_s)
    _enter(folder, name, done)
    return done


def _enter(folder: Path, name: str, done: Recorded) -> None:
    """Lists the run in the session; it has neither one speed nor one depth."""
    info = open_session(folder).info
    entry = TrialInfo(
        name,
        done.file.name,
        speed_mm_s=math.nan,
        depth_mm=math.nan,
        outcome=done.outcome.outcome,
        peak_force_N=done.outcome.peak_force_N,
        samples=done.samples,
        dropped=done.dropped,
    ).sealed(folder)
    entry = with_quality(with_surface(entry, done.outcome), folder, QualityLimits())
    write_session(folder, replace(info, trials=(*(one for one in info.trials if one.name != name), entry)))


def duration_s(program: Program) -> float:
    """How long it holds forces; the way there and back depends on where the surface is."""
    return sum(step.given.duration_s for step in program.steps if isinstance(step, TrackForce))


def _free_name(folder: Path) -> str:
    number = 1
    while (folder / f"track_{number:03d}.mcap").exists():
        number += 1
    return f"track_{number:03d}"


def evaluate(done: Recorded, model: str) -> TrackResult:
    """The levels of a finished run, from its loop stream."""
    loop = read_recording(done.file).tables["loop"]
    columns = (loop["capture_ns"] * 1e-9, loop["reference_N"], loop["force_N"], loop["mode"])
    first, last = (LoopSample(*row) for row in (loop[0].tolist(), loop[-1].tolist()))
    levels = tracking.plateaus(*columns)
    return TrackResult(
        recording=done.file.name,
        model=model,
        max_error_percent=max((level.max_error_percent for level in levels), default=None),
        rms_error_N=math.sqrt(fmean(level.rms_error_N**2 for level in levels)) if levels else None,
        levels=levels,
        followed=tracking.followed(*columns),
        samples=sum(done.samples.values()),
        dropped=sum(done.dropped.values()),
        loop=LoopCount(cycles=last.seq - first.seq + 1, missed=last.missed - first.missed),
    )


def refuse_bad(result: TrackResult) -> None:
    """Raises BadTrial where the run's quality is bad."""
    if result.quality == "bad":
        raise BadTrial(f"{result.recording} is of bad quality: {'; '.join(result.reasons)}; mend that and track again")
