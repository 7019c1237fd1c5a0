"""From a request to a job: names are looked up and limits checked before anything begins."""

from collections.abc import Callable

from api.http.commissioning.alone import Alone, refuse_undoable
from api.http.commissioning.params import MovingParams
from api.http.jobs.job import Job
from api.http.jobs.kinds import KINDS, AnyJob, Kind
from api.http.jobs.motion import planned
from api.http.jobs.params import ExportParams, ImportParams, ModelRef, RepairParams, VerifyParams
from api.http.jobs.places import Places
from api.http.jobs.process import Computation
from api.http.jobs.wire import Order
from api.http.models import RequestBody
from api.http.room import refuse_full, size_of
from api.http.service import Service
from controller.operation import Operation
from rig.results.base import SavedResult
from rig.results.bench import DoctorResult

# A synthetic session takes 3 times its recordings in all formats together, and 3.5 times what it has as MAT.
MOST_GROWTH = 4


def start(service: Service, body: AnyJob, by: str, lease: str = "") -> Job:
    """The job that ``body`` asks for; raises what it refuses, and then nothing has begun."""
    kind = KINDS[body.kind]
    if not kind.moves:
        return _computing(service, body, kind, by)
    return (_alone if kind.work else _moving)(service, body, kind, by, lease)


def _moving(service: Service, body: AnyJob, kind: Kind, by: str, lease: str) -> Job:
    plan = planned(body, service.the_bench(), service.jobs.places(""))
    job = service.jobs.new(kind, body.params, by, plan.session, plan.operation)
    job.lease, job.interrupt = lease, service.stop_softly
    with service.starting:
        service.jobs.refuse_busy()
        service.refuse_stopped()
        return service.jobs.start_moving(job, plan.work)


def _alone(service: Service, body: AnyJob, kind: Kind, by: str, lease: str) -> Job:
    """In a process that has the devices to itself: the loop ends for it, which leaves the tip out."""
    refuse_undoable(body.params, service.wiring, kind.name in service.works)
    job = service.jobs.new(kind, body.params, by, None, Operation(kind.name))
    job.lease, alone = lease, Alone(service, job, isinstance(body.params, MovingParams))
    return alone.begun(_work(service, job, kind, alone.word))


def _computing(service: Service, body: AnyJob, kind: Kind, by: str) -> Job:
    places = service.jobs.places("")
    _check(places, body.params)
    _refuse_full(places, body.params)
    job = service.jobs.new(kind, body.params, by, _session(body.params), Operation(kind.name))
    seen = service.seen_devices() if kind.name == "doctor" else None
    if seen is not None:
        return service.jobs.start_computing(job, lambda: DoctorResult(devices=seen))
    return service.jobs.start_computing(job, _work(service, job, kind))


def _work(service: Service, job: Job, kind: Kind, stop_word: str = "") -> Callable[[], SavedResult]:
    """Of a process of its own."""
    order = Order(
        kind=kind.name, work=service.works.get(kind.name, kind.work), params=job.asked.params,
        wiring=service.wiring.model_dump_json(), hands=service.hands, stop_word=stop_word,
        **service.jobs.places(job.id)._asdict(),
    )  # fmt: skip
    computation = Computation(order, job.ask)
    job.interrupt, job.go_on = computation.cancel, computation.done
    return lambda: kind.result.model_validate_json(computation.run(job.operation))


def _session(asked: RequestBody) -> str | None:
    """The session it works on, where that is one."""
    several: list[str] = getattr(asked, "sessions", [])
    found: str | None = getattr(asked, "session", None)
    return several[0] if len(several) == 1 else found


def _refuse_full(places: Places, asked: RequestBody) -> None:
    match asked:
        case ExportParams():
            source = places.place(asked.session, asked.upload)
        case ImportParams():
            source = places.upload(asked.upload)
        case _:
            return
    refuse_full(places.sessions, MOST_GROWTH * size_of(source))


def _check(places: Places, asked: RequestBody) -> None:
    """Whatever is named has to be there, and what is made must not."""
    for name, value in asked:
        match name, value:
            case "upload", str():
                places.upload(value)
            case "session", str():
                look = places.new_session if isinstance(asked, ImportParams) else places.session
                look(value)
            case "sessions", list():
                for session in value:
                    places.session(session)
            case "protocol", str():
                places.protocol(value)
            case _, ModelRef():
                places.model(value)
    if isinstance(asked, RepairParams | VerifyParams) and asked.recording:
        places.recording(asked.session, asked.recording)
