"""What the recordings of a session look like: few samples of each, for a page that draws them."""

import asyncio
import functools
import math
from pathlib import Path

import numpy as np
from fastapi import APIRouter, Response
from pydantic import Field

from api.http.access.rights import READ
from api.http.jobs.places import refuse_links
from api.http.priority import following
from api.http.problems import RequestRefused, responses
from api.http.service import Service
from rig.errors import DataError, RigError
from rig.recording.converter import Array
from rig.recording.reader import Recording, read_recording
from rig.recording.sessions import Session, TrialInfo, open_session
from rig.results.base import Number, Result
from rig.trials.cycles import cycle_of
from rig.trials.recorded import NS, trial_of
from rig.trials.surface import find_surface
from rig.trials.thinning import extremes
from rig.trials.trial import Trial

# Two a pixel of a plot half as wide as a screen.
POINTS = 800
# A page that draws more lines shows none of them.
MOST_CURVES = 60
# A minute of every stream is 15 MB; what takes seconds to read is for the fit, not for a look.
LARGEST_BYTES = 60_000_000


class CurveView(Result):
    """A recording, thinned so that every peak stays; ``depth_mm`` counts from the surface where that is known."""

    name: str
    quality: str = ""
    speed_mm_s: Number = None
    tracks_force: bool = False
    from_surface: bool = Field(default=False, description="otherwise depth_mm is the position of the axis")
    time_s: tuple[float, ...] = ()
    force_N: tuple[Number, ...] = ()
    depth_mm: tuple[Number, ...] = ()
    reference_N: tuple[Number, ...] = Field(default=(), description="of a tracked force; else empty")
    problem: str = Field(default="", description="why there is nothing to draw; empty if there is")


class CurvesView(Result):
    """The recordings of a session, in their order; ``left_out`` of them are too many to draw."""

    session: str
    curves: tuple[CurveView, ...]
    left_out: int = 0


def add(router: APIRouter, service: Service) -> None:
    """Its route: one is made at a time, as each holds the interpreter; those that wait hold no thread."""
    one_at_a_time = asyncio.Lock()

    @router.get(
        "/sessions/{session}/curves",
        dependencies=[READ],
        response_model=CurvesView,
        summary="Force and depth of every recording, thinned for a plot",
        responses=responses("404 no-such-session", "409 link", "409 no-recording"),
    )
    async def curves(session: str) -> Response:
        async with one_at_a_time:
            made = await asyncio.to_thread(following(_made), service, session)
        return Response(made, media_type="application/json")


def _made(service: Service, session: str) -> str:
    refuse_links(folder := service.session(session))
    try:
        found = open_session(folder)
    except RigError as error:
        raise RequestRefused(409, "no-recording", str(error)) from error
    drawn = found.trials[:MOST_CURVES]
    lines = tuple(_curve(found, trial) for trial in drawn)
    return CurvesView(session=session, curves=lines, left_out=len(found.trials) - len(drawn)).model_dump_json()


def _curve(session: Session, trial: TrialInfo) -> CurveView:
    path = session.folder / trial.file
    about = {"name": trial.name, "quality": trial.quality, "speed_mm_s": trial.speed_mm_s}
    try:
        now = path.stat()
        if now.st_size > LARGEST_BYTES:
            raise RequestRefused(422, "too-large", f"{now.st_size / 1e6:.0f} MB are too many to draw here; export it")
        found = _drawn(path, now.st_mtime_ns, trial.surface_mm)
    except (RequestRefused, RigError, OSError) as error:
        return CurveView.model_validate({**about, "problem": str(error)})
    return found.model_copy(update=CurveView.model_validate(about).model_dump(include=set(about)))


@functools.lru_cache(maxsize=4 * MOST_CURVES)
def _drawn(path: Path, changed_ns: int, surface_mm: float) -> CurveView:  # noqa: ARG001 - what is kept is of this state
    recording = read_recording(path)
    rows = recording.tables["loop"]
    return _of_loop(recording) if len(rows) else _of_streams(recording, surface_mm)


def _of_loop(recording: Recording) -> CurveView:
    """As the loop saw it: force from its zero, depth from the surface it found."""
    rows = recording.tables["loop"]
    kept = _kept(rows["force_N"], rows["position_mm"])
    force_N, depth_mm, reference_N = (rows[name][kept] for name in ("force_N", "depth_mm", "reference_N"))
    from_surface = bool(np.isfinite(depth_mm).any())
    return _view(
        time_s=(rows["capture_ns"][kept] - rows["capture_ns"][0]) * NS,
        force_N=force_N,
        depth_mm=depth_mm if from_surface else rows["position_mm"][kept],
        reference_N=reference_N if recording.tracks_force else np.zeros(0),
        from_surface=from_surface,
        tracks_force=recording.tracks_force,
    )


def _of_streams(recording: Recording, surface_mm: float) -> CurveView:
    """As the devices gave it, on depth from the surface stated, else found: nobody zeroed its force."""
    trial = trial_of(recording.path.stem, recording)
    if not len(trial.force_s):
        return CurveView(name="", problem="no force sample is valid")
    stated_mm = trial.surface_mm if math.isnan(surface_mm) else surface_mm
    surface_mm = _found_mm(trial) if math.isnan(stated_mm) else stated_mm
    kept = extremes(trial.force_N, POINTS)
    time_s = trial.force_s[kept]
    position_mm = np.interp(time_s, trial.axis_s, trial.axis_mm) if len(trial.axis_s) else np.full(len(kept), math.nan)
    known = math.isfinite(surface_mm)
    return _view(
        time_s=time_s,
        force_N=trial.force_N[kept],
        depth_mm=position_mm - surface_mm if known else position_mm,
        reference_N=np.zeros(0),
        from_surface=known,
        tracks_force=recording.tracks_force,
    )


def _found_mm(trial: Trial) -> float:
    """The surface where a fit finds it, NaN where it finds none."""
    try:
        return find_surface(cycle_of(trial)).contact.position_mm
    except DataError:
        return math.nan


def _kept(force_N: Array, position_mm: Array) -> "np.ndarray[tuple[int], np.dtype[np.intp]]":
    """Peaks of force where there is any, else of the motion."""
    known = np.flatnonzero(np.isfinite(force_N))
    return known[extremes(force_N[known], POINTS)] if len(known) else extremes(position_mm, POINTS)


def _view(*, from_surface: bool, tracks_force: bool, **columns: Array) -> CurveView:
    lists = {name: values.tolist() for name, values in columns.items()}
    return CurveView.model_validate({"name": "", "from_surface": from_surface, "tracks_force": tracks_force, **lists})
