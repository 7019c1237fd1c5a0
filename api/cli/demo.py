"""`rig demo`: the whole job on the mock bench, from capture to report, in under three minutes.

A cause is hidden in the bench, drawn at random; the analysis is not told, and the truth comes out last.
"""

import secrets
import shutil
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from api.cli import live
from api.cli.diagnose import diagnosed
from api.cli.fitting import fitted as fit_session
from api.cli.hidden_effect import draw
from api.cli.motion import captured, followed
from api.cli.options import built_in
from api.cli.output import console, show
from api.operations.motion import TrackPlan
from api.operations.records import refuse_incomplete, verify
from api.operations.report import report
from controller.experiments import capture as experiment
from controller.experiments import tracked
from controller.law.gain_table import DampingUnknown
from controller.loop.steps import Program
from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.config.wiring import Wiring
from rig.diagnosis.design import check
from rig.errors import DataError, SafetyStop, UsageError
from rig.intake.questions import inline
from rig.recording.files import make_folder, refuse_unwritable, write_text
from rig.recording.sessions import derive
from rig.results.demo import DemoSummary, HiddenTruth
from rig.results.diagnosis import FILE, FOLDER, TRUTH, DiagnosisResult
from rig.results.diagnosis import MODEL as MODEL_FILE
from rig.results.fit import FitResult
from rig.results.tables import track_parts
from rig.results.tracking import TrackResult
from rig.tissue.model import load_model

PLAN = Indentation(
    name="demonstration", trials=2, air_dwell_s=0.3, approach_speed_mm_s=6.0, hold_s=0.4, dither_amplitude_mm=0.3,
    dither_s=0.4, retract_speed_mm_s=20.0, clearance_mm=4.0, rest_s=0.1,
)  # fmt: skip
LARGEST_SEED = 100_000  # five digits: soon typed again, and seldom drawn twice
FORCES_N = (1.0, 2.0, 3.0, 4.0, 5.0)
SECONDS = 3.0
MODEL, EXTENDED = Path("fit") / MODEL_FILE, Path(FOLDER) / MODEL_FILE
# What stops a bench whose computer stood still for a tenth of a second; a demonstration then begins again.
LATE = {"drive_fault", "axis_lost", "force_lost", "tracker_lost", "loop_overrun", "recorder_stalled", "stop_lost"}
AGAIN = 2
SUMMARY, REPORT, SESSION, PROTOCOLS = "summary.json", "report.html", "session", "protocols"
TrialsOption = Annotated[
    int | None, typer.Option(min=1, max=5, help="Trials at each speed; else 2, or the protocol's own.")
]
ProtocolOption = Annotated[
    Path | None, typer.Option(help="Recorded instead of a short one, for example examples/diagnosis.toml (4 minutes).")
]
OutOption = Annotated[Path, typer.Option("--out", help="Folder for session, report and summary.")]


def demo(
    out: OutOption = Path("demo"),
    trials: TrialsOption = None,
    protocol: ProtocolOption = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of what is hidden in the bench; else drawn.")] = None,
    serve: Annotated[bool, typer.Option("--serve", help="Then serves the session, until Ctrl-C.")] = False,
    port: Annotated[int, typer.Option(min=1, max=65535, help="With --serve: TCP port to listen on.")] = 8000,
) -> None:
    """Does the whole job on the mock bench: capture, fit, track, diagnose, verify, report, and the truth at the end.

    With --serve it ends with an address that logs a browser in once, where all of it is shown and can be done again.

    Example: rig demo --out demo
    """
    if serve:
        from api.cli.serve import refuse_taken  # noqa: PLC0415 - loads the service

        refuse_taken(port)
    refuse_unwritable(out / SUMMARY)
    session, wiring = out / SESSION, built_in()
    plan = PLAN if protocol is None else load(Indentation, protocol)
    plan = plan.model_copy(update={"trials": trials or plan.trials})
    experiment.check(plan, wiring)
    seed = secrets.randbelow(LARGEST_SEED) if seed is None else seed
    secret = draw(np.random.default_rng(seed), check(plan).detectable)
    show(f"a cause is hidden in the bench; --seed {seed} hides the same again")
    fitted, result = measured(wiring, secret.hide, plan, out)
    show(*track_parts(result))
    known = DiagnosisResult.read_or_why(session / FOLDER / FILE, "This session was not diagnosed", "rig diagnose")
    diagnosis = _diagnosed(session) if isinstance(known, str) else known
    console.rule("verify and report")
    refuse_incomplete(verify(Operation("verify"), session), session)
    derive(session)
    hidden = HiddenTruth(
        effect=secret.effect, parameters=secret.knobs, seed=seed,
        named=secret.found_in(diagnosis) is not None, inside=secret.inside(diagnosis),
    )  # fmt: skip
    _reported(out, secret.sentence(diagnosis), fitted, result, diagnosis, hidden)
    if serve:
        console.rule("served until Ctrl-C")
        served(out, plan, port)


def _reported(
    out: Path, truth: str, fit: FitResult, tracking: TrackResult, diagnosis: DiagnosisResult, hidden: HiddenTruth
) -> None:
    """Writes page and summary, and says the truth."""
    write_text(out / SESSION / FOLDER / TRUTH, truth + "\n")
    page = report(Operation("report"), out / SESSION, out / REPORT)
    found = DemoSummary(**dict(page), fit=fit, tracking=tracking, diagnosis=diagnosis, hidden=hidden)
    found.write(out / SUMMARY)
    show(f"{page.recordings} recordings, {page.samples} samples, {page.dropped} dropped")
    show(f"{page.file} shows it; {out / SUMMARY} has the figures")
    console.rule("the truth")
    show(truth)


def measured(
    wiring: Wiring, hide: tuple[str, ...], plan: Indentation, out: Path, again: int = AGAIN
) -> tuple[FitResult, TrackResult]:
    """What the fit and the tracking showed; begun again where this computer was late or the trials were too few."""
    _clear(out)
    session = out / SESSION
    try:
        with live.running(wiring, hide) as bench:
            console.rule(f"capture: {len(plan.speeds_mm_s)} speeds, {plan.trials} trials each")
            captured(bench, plan, session)
            console.rule("fit: constant stiffness against the index law")
            fitted = fit_session([session])
            model = model_to_track_with(session)
            console.rule("track: gains from the tangent stiffness of the model")
            return fitted, followed(bench, TrackPlan(_forces(bench, session / model), str(model)), session)
    except (DampingUnknown, DataError) as unknown:  # too few trials, or of a computer that was late
        if not again:
            raise
        show(f"{unknown}; the demonstration begins again, with one trial more at each speed")
        plan = plan.model_copy(update={"trials": plan.trials + 1})
    except SafetyStop as stop:
        if not again or stop.code not in LATE:
            raise
        show(f"{stop}; this computer, which simulates the bench, was late, so the demonstration begins again")
    return measured(wiring, hide, plan, out, again - 1)


def served(out: Path, plan: Indentation, port: int) -> None:
    """The session, on a bench with nothing hidden, and the protocol that it was recorded by."""
    from api.cli.serve import serve_here  # noqa: PLC0415 - only a demonstration that is served needs it

    make_folder(out / PROTOCOLS)
    write_text(out / PROTOCOLS / f"{plan.name}.toml", as_toml(plan))
    serve_here(built_in(), out, out / PROTOCOLS, port)


def as_toml(plan: Indentation) -> str:
    """What is not as usual, as a protocol's file."""
    stated = {"kind": plan.kind, **plan.model_dump(mode="json", exclude_defaults=True)}
    return "".join(f"{key} = {inline(value)}\n" for key, value in stated.items())


def _clear(out: Path) -> None:
    """Removes an earlier demonstration, and nothing else."""
    own = (SUMMARY, REPORT, SESSION, PROTOCOLS)
    strangers = [path.name for path in out.iterdir() if path.name not in own] if out.exists() else []
    if strangers:
        raise UsageError(
            f"{out}: holds {', '.join(sorted(strangers))}, which no demonstration made; give another folder"
        )
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)


def model_to_track_with(session: Path) -> Path:
    """In ``session`` the model of its fit; where that misses too much of a displacement, as a diagnosis extends it."""
    try:
        load_model(session / MODEL).check_force(0.0)
    except DataError as missed:
        show(str(missed))
        _diagnosed(session)
        return EXTENDED
    return MODEL


def _diagnosed(session: Path) -> DiagnosisResult:
    console.rule("diagnose: what the simulation gets wrong")
    return diagnosed(session, out=session / FOLDER)


def _forces(bench: Supervisor, file: Path) -> Program:
    model = load_model(file)
    # A limb that softens was pressed harder at first than its model reaches.
    largest_N = min(model.valid.force_N, model.force_N(model.valid.depth_mm))
    return tracked.plan(forces_within(largest_N), SECONDS, model, bench.wiring)


def forces_within(largest_N: float) -> tuple[float, ...]:
    """1 to 5 N; where the model was fitted to less, five steps that leave it room at the end."""
    if largest_N >= FORCES_N[-1]:
        return FORCES_N
    return tuple(round(force_N / FORCES_N[-1] * 0.85 * largest_N, 2) for force_N in FORCES_N)
