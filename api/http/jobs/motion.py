"""Jobs that use the bench of the service: what each is checked for, and what it then does in a thread of its own."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from api.http.jobs.kinds import AnyJob, CaptureJob, GloveThresholdJob, RetractJob, ThresholdJob, TrackJob
from api.http.jobs.params import GloveThresholdParams, ModelRef, ThresholdParams, TrackParams
from api.http.jobs.places import Places
from api.http.jobs.references import reference_of
from api.operations import glove, motion
from api.operations.motion import TrackPlan
from controller.experiments import capture as experiment
from controller.experiments import threshold as ramp
from controller.experiments import tracked
from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.recording.sessions import open_session
from rig.results.base import SavedResult
from rig.tissue.model import load_model


class Planned(NamedTuple):
    """A job that was checked: its operation, the session it records, and its work."""

    operation: Operation
    session: str | None
    work: Callable[[], SavedResult]


def planned(body: AnyJob, bench: Supervisor, places: Places) -> Planned:
    """All checks of a job, before anything moves; raises UsageError with what is wrong."""
    match body:
        case CaptureJob():
            return _capture(body, bench, places)
        case TrackJob():
            return _track(body.params, bench, places)
        case ThresholdJob():
            return _threshold(body, bench, places)
        case GloveThresholdJob():
            return _by_glove(body.params, bench, places)
        case RetractJob():
            operation = Operation("retract", total=1, unit="moves")
            return Planned(operation, None, lambda: motion.retract(operation, bench))
    raise AssertionError(f"{body.kind} does not use the bench")


def _capture(body: CaptureJob, bench: Supervisor, places: Places) -> Planned:
    name = body.params.session
    plan = load(Indentation, places.protocol(body.params.protocol))
    experiment.check(plan, bench.wiring)
    folder, operation = places.new_session(name), motion.capture_operation(plan)
    return Planned(operation, name, lambda: motion.capture(operation, bench, plan, folder))


def _track(asked: TrackParams, bench: Supervisor, places: Places) -> Planned:
    wanted = _plan(asked, asked.model, bench, places)
    against = _plan(asked, asked.against, bench, places) if asked.against else None
    name, folder = _session(asked, bench, places)
    operation = Operation("track", total=2 if against else 1, unit="runs")
    return Planned(operation, name, lambda: motion.track(operation, bench, wanted, folder, against))


def _plan(asked: TrackParams, ref: ModelRef, bench: Supervisor, places: Places) -> TrackPlan:
    file = places.model(ref)
    model = load_model(file)
    if asked.forces_N:
        program = tracked.plan(asked.forces_N, asked.seconds, model, bench.wiring)
    else:
        program = tracked.plan_reference(reference_of(asked), model, bench.wiring)
    return TrackPlan(program, str(file.relative_to(places.sessions)))


def _own(session: str, bench: Supervisor, places: Places) -> str:
    """The model's session where that is of who is on the bench; else one of their own, by the time."""
    whose, now = open_session(places.session(session)).info.subject.get("id"), datetime.now(UTC)
    return session if whose in (None, bench.wiring.subject.id) else f"{now:%Y%m%d-%H%M%S}"


def _session(asked: TrackParams | ThresholdParams, bench: Supervisor, places: Places) -> tuple[str, Path]:
    """Name and folder of the session that is recorded into; raises UsageError where that holds something else."""
    name = asked.session or _own(asked.model.session, bench, places)
    folder = places.recorded_into(name)
    tracked.refuse_foreign(folder)
    return name, folder


def _threshold(body: ThresholdJob, bench: Supervisor, places: Places) -> Planned:
    asked, file = body.params, places.model(body.params.model)
    program = ramp.plan(asked.up_to_N, asked.rate_N_s, load_model(file), bench.wiring)
    plan = TrackPlan(program, str(file.relative_to(places.sessions)))
    name, folder = _session(asked, bench, places)
    operation = Operation("threshold", total=1, unit="ramps")
    return Planned(operation, name, lambda: motion.threshold(operation, bench, plan, asked.up_to_N, folder))


def _by_glove(asked: GloveThresholdParams, bench: Supervisor, places: Places) -> Planned:
    folder, operation = places.recorded_into(asked.session), glove.threshold_operation()
    name = glove.check(bench.wiring, asked.input, folder)
    return Planned(operation, asked.session, lambda: glove.threshold_beside(operation, bench, name, folder))
