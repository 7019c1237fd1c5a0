"""What moves the tip of a running bench: capture, track, threshold, retract."""

from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from controller.experiments import capture as experiment
from controller.experiments import threshold as ramp
from controller.experiments import tracked
from controller.experiments.verdicts import remaining_bad
from controller.loop.steps import Program, Retract
from controller.operation import Operation
from controller.supervisor import Supervisor, stop_error
from rig.config.protocol import Indentation
from rig.errors import SafetyStop
from rig.recording.sessions import SessionInfo
from rig.results.bench import RetractResult
from rig.results.recorded import CaptureResult, captured_trial
from rig.results.tracking import Threshold, TrackResult, compare_runs

# Out of any depth that a protocol may reach, and slow enough to see it coming.
RETRACT_MM = 20.0
RETRACT_MM_S = 10.0
# Where the wiring allows 1 mm/s, these take 20 s; whoever waits longer is told.
RETRACT_TIMEOUT_S = 60.0


class Captured(CaptureResult):
    """A session as it was recorded."""

    info: SessionInfo = Field(exclude=True)


@dataclass(frozen=True)
class TrackPlan:
    """A program of force tracking, and the file of the model that its gains are from."""

    program: Program
    model: str


def capture_operation(protocol: Indentation) -> Operation:
    """The operation that ``capture`` is to report to."""
    return Operation(f"capture {protocol.name}", total=len(protocol.speeds_mm_s) * protocol.trials, unit="trials")


def capture(operation: Operation, bench: Supervisor, protocol: Indentation, folder: Path) -> Captured:
    """Records the protocol's trials into the new session ``folder``; SafetyStop, with what there is kept, at a stop."""
    info = experiment.capture(bench, protocol, folder, operation)
    return Captured(
        info=info,
        session=str(folder),
        recordings=len(info.trials),
        samples=sum(sum(trial.samples.values()) for trial in info.trials),
        dropped=sum(sum(trial.dropped.values()) for trial in info.trials),
        trials=tuple(map(captured_trial, info.trials)),
        bad=tuple(trial.name for trial in remaining_bad(info)),
    )


def track(
    operation: Operation, bench: Supervisor, wanted: TrackPlan, folder: Path, against: TrackPlan | None = None
) -> TrackResult:
    """Tracks force into the session ``folder``, first ``against`` another model; SafetyStop at a stop."""
    own_s = tracked.duration_s(wanted.program)
    before = _track(operation, bench, against, folder, own_s) if against else None
    if operation.cancelled:
        raise SafetyStop("stopped by the operator before the second run")
    found = _track(operation, bench, wanted, folder)
    return compare_runs(before, found) if before else found


def _track(
    operation: Operation, bench: Supervisor, wanted: TrackPlan, folder: Path, then_s: float = 0.0
) -> TrackResult:
    done = operation.progress.done
    operation.expect(tracked.duration_s(wanted.program) + then_s)
    operation.advance(done, wanted.program.name)
    found = tracked.run(bench, wanted.program, folder, wanted.model)
    operation.advance(done + 1, "done")
    return found


def threshold(operation: Operation, bench: Supervisor, wanted: TrackPlan, up_to_N: float, folder: Path) -> Threshold:
    """Raises force until the subject stops it, into the session ``folder``; SafetyStop at any other stop."""
    operation.expect(tracked.duration_s(wanted.program))
    operation.advance(0, wanted.program.name)
    return ramp.run(bench, wanted.program, up_to_N, folder, wanted.model)


def retract(operation: Operation, bench: Supervisor) -> RetractResult:
    """Moves the tip out of wherever a stop left it, at most to the end of the workspace."""
    limits = bench.wiring.limits
    speed_mm_s = min(RETRACT_MM_S, limits.retract_speed_mm_s)
    leave = Retract(clearance_mm=RETRACT_MM, speed_mm_s=speed_mm_s, floor_mm=limits.position_min_mm)
    operation.expect(RETRACT_MM / speed_mm_s)
    operation.advance(0, "retract")
    outcome = bench.run(Program(name="retract", steps=(leave,)), RETRACT_TIMEOUT_S)
    if outcome.stopped:
        raise stop_error(outcome)
    return RetractResult(outcome=outcome.outcome)
