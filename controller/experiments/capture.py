"""A session of trials: each into its own recording, the session's index rewritten after each."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from pydantic import JsonValue

import rig
from controller.experiments.indentation import PlannedTrial, attempts, longest_s, trials
from controller.experiments.recorded import metadata, record, refuse_bench
from controller.experiments.verdicts import sentences, with_quality, with_surface
from controller.operation import Operation
from controller.safety.program_limits import refuse_beyond_limits
from controller.supervisor import Supervisor, stop_error
from rig.config.protocol import Indentation
from rig.config.wiring import Wiring
from rig.errors import RigError, SafetyStop, UsageError
from rig.recording.files import make_folder, refuse_unwritable
from rig.recording.sessions import SESSION_FILE, SessionInfo, TrialInfo, write_session

# As 12 N of the protocols before 15 N of the default: at 30 mm/s a compression ends, and nothing is stopped.
BEFORE_THRESHOLD = 0.8


def check(protocol: Indentation, wiring: Wiring) -> Indentation:
    """The protocol as this subject bears it: its compressions end before the threshold, which stops everything.

    Raises UsageError, before anything moves or is opened, where it goes beyond the limits.
    """
    threshold_N = wiring.subject.threshold_N
    if protocol.force_limit_N > threshold_N:
        protocol = protocol.model_copy(update={"force_limit_N": BEFORE_THRESHOLD * threshold_N})
    if protocol.deepest_mm > wiring.limits.depth_mm:
        raise UsageError(
            f"protocol {protocol.name} goes {protocol.deepest_mm:g} mm deep, above limits.depth_mm"
            f" {wiring.limits.depth_mm:g} mm: lower the protocol's depth or raise the limit"
        )
    for trial in trials(protocol):
        refuse_beyond_limits(trial.program, wiring)
    return protocol


def refuse_used(folder: Path) -> None:
    """Raises UsageError where a new session cannot begin in ``folder``."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file; give a new folder")
    if folder.exists() and any(folder.iterdir()):
        raise UsageError(f"{folder}: is not empty; give a new folder, recordings are never overwritten")
    refuse_unwritable(folder / SESSION_FILE)


def new_session(
    folder: Path, kind: Literal["capture", "track"], protocol: Mapping[str, JsonValue], wiring: Wiring
) -> SessionInfo:
    """An empty session in ``folder``; raises UsageError where there is one already."""
    refuse_used(folder)
    make_folder(folder)
    info = SessionInfo(
        id=folder.resolve().name, kind=kind, created=datetime.now(UTC).isoformat(),
        software=f"tissue-rig {rig.__version__}", protocol=dict(protocol),
        wiring=wiring.model_dump(mode="json"), subject=wiring.subject.model_dump(mode="json"),
    )  # fmt: skip
    write_session(folder, info)
    return info


def capture(bench: Supervisor, protocol: Indentation, folder: Path, operation: Operation) -> SessionInfo:
    """Runs all trials, bad ones again; raises SafetyStop, with everything recorded kept, where a trial was stopped."""
    asked_N, protocol = protocol.force_limit_N, check(protocol, bench.wiring)
    if protocol.force_limit_N < asked_N:
        operation.say(
            f"each compression ends at {protocol.force_limit_N:.3g} N: the protocol's force limit of {asked_N:g} N is"
            f" above the subject's threshold, {bench.wiring.subject.threshold_N:g} N"
        )
    planned = trials(protocol)
    refuse_bench(bench, planned[0].program)
    info = new_session(folder, "capture", protocol.model_dump(mode="json"), bench.wiring)
    for trial in planned:
        for attempt in attempts(trial, protocol.quality.repeats):
            operation.advance(trial.index - 1, f"{attempt.name}, {trial.speed_mm_s:g} mm/s")
            result, cause = _run(bench, attempt, protocol, folder, info)
            if cause is not None and not folder.is_dir():
                raise cause  # there is nothing left to note it in
            info = replace(info, trials=(*info.trials, result))
            write_session(folder, info)
            operation.say(*sentences(result))
            if cause is not None:
                raise cause
            if operation.cancelled:
                raise SafetyStop(f"stopped by the operator after {trial.index} of {len(planned)} trials")
            if result.quality != "bad":
                break
    operation.advance(len(planned), "done")
    return info


def _run(
    bench: Supervisor, trial: PlannedTrial, protocol: Indentation, folder: Path, info: SessionInfo
) -> tuple[TrialInfo, RigError | None]:
    speed_mm_s, depth_mm = trial.speed_mm_s, protocol.depth_mm
    known = {"index": trial.index, "speed_mm_s": speed_mm_s, "depth_mm": depth_mm, "repeats": trial.repeats}
    about = {"trial": known, "protocol": protocol.model_dump(mode="json")}
    file = folder / f"{trial.name}.mcap"
    planned = TrialInfo(trial.name, file.name, speed_mm_s, depth_mm, "failed", repeats=trial.repeats)
    longest = longest_s(protocol, trial.speed_mm_s, bench.wiring.limits.position_max_mm)
    try:
        done = record(bench, trial.program, file, metadata(bench, info.id, trial.name, about), longest)
    except RigError as error:
        return planned, error
    outcome = done.outcome
    result = replace(
        with_surface(planned, outcome), outcome=outcome.outcome, peak_force_N=outcome.peak_force_N,
        samples=done.samples, dropped=done.dropped,
    ).sealed(folder)  # fmt: skip
    result = with_quality(result, folder, protocol.quality, info.trials)
    return result, stop_error(outcome) if outcome.stopped else None
