"""Jobs that fit, criticise and simulate."""

from dataclasses import replace
from pathlib import Path

from api.http.jobs.params import DiagnoseParams, FitParams, LatticeParams, ProtocolCheckParams, SimulateParams
from api.http.jobs.references import reference_of
from api.http.jobs.work_recordings import opening, out_of
from api.http.jobs.worker import Desk
from api.operations import diagnose as criticism
from api.operations import fit as fitting
from api.operations.fit import Lattice, Laws
from controller.operation import Operation, Progress
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.results.diagnosis import FOLDER, DiagnosisResult, ProtocolCheckResult
from rig.results.fit import FitResult
from rig.results.tracking import SimulateResult
from rig.tissue.model import load_model
from rig.tissue.registry import check_known
from rig.trials.opening import Opening


def fit(operation: Operation, asked: FitParams, desk: Desk) -> FitResult:
    """Into the one session; of several, or an upload, into the job's own folder."""
    places = desk.places
    found = [places.session(name) for name in asked.sessions] or [places.upload(asked.upload or "")]
    out = None if len(asked.sessions) == 1 else places.files
    lattice = _lattice(asked.lattice) if asked.lattice else None
    extended = places.model(asked.extended) if asked.extended else None
    how = Opening(places.text("mapping.toml", asked.mapping), asked.only)
    inner = relayed(fitting.fit_operation(lattice), operation)
    return fitting.fit(inner, found, out, _laws(asked, extended), lattice, how)


def relayed(inner: Operation, outer: Operation) -> Operation:
    """``inner``, which counts its own parts, told as a share of ``outer``, and cancelled with it."""
    told = 0

    def watch(now: Progress) -> None:
        nonlocal told
        if now.log[told:]:
            outer.say(*now.log[told:])
        told = len(now.log)
        outer.step(now.message, now.done / now.total)

    inner.watch = watch
    return inner


def _laws(asked: FitParams, extended: Path | None) -> Laws:
    found = fitting.laws_of(asked.laws, asked.model, extended)
    check_known(asked.known, found.compared)
    return replace(found, known=asked.known)


def _lattice(asked: LatticeParams) -> Lattice:
    from api.operations.lattice import lattice_from  # noqa: PLC0415 - compiled kernels take seconds to load

    return lattice_from(asked.block, asked.springs, asked.per_spring)


def diagnose(operation: Operation, asked: DiagnoseParams, desk: Desk) -> DiagnosisResult:
    """Into the session; of an upload into the job's own folder."""
    place = desk.places.place(asked.session, asked.upload)
    out = out_of(asked, desk, FOLDER) or place / FOLDER
    reference = desk.places.text("reference.toml", asked.reference)
    return criticism.diagnose(
        operation, place, asked.simulation, out, opening(asked, desk), reference, asked.detectability
    )


def protocol_check(operation: Operation, asked: ProtocolCheckParams, desk: Desk) -> ProtocolCheckResult:
    """Its picture goes into the job's own folder."""
    protocol = load(Indentation, desk.places.protocol(asked.protocol))
    tissue = load_model(desk.places.model(asked.model)) if asked.model else None
    return criticism.check_protocol(operation, protocol, asked.tracker, asked.rate_Hz, desk.places.files, tissue)


def simulate(operation: Operation, asked: SimulateParams, desk: Desk) -> SimulateResult:
    """Its pictures go into the job's own folder."""
    from api.operations import simulate as simulation  # noqa: PLC0415 - the loop's kernels take a second to load

    model = load_model(desk.places.model(asked.model))
    wanted = simulation.SimulatedRun(reference_of(asked), model, asked.stiffness, asked.breathing_mm)
    return simulation.simulate(operation, desk.wiring, wanted, desk.places.files)
