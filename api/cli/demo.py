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
from api.cli.hidden_effect import HiddenCause, draw
from api.cli.motion import captured, followed
from api.cli.options import built_in
from api.cli.output import console, show
from api.cli.stage import bench_for
from api.operations.motion import TrackPlan
from controller.experiments import capture as experiment
from controller.experiments import tracked
from controller.supervisor import Supervisor
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.errors import CheckFailed, UsageError
from rig.recording.files import write_text
from rig.recording.sessions import derive, open_session
from rig.recording.verify import verify
from rig.report.page import write_report
from rig.results.demo import DemoDiagnosis, DemoSummary, DemoTracking, HiddenTruth, RecordingCounts
from rig.results.diagnosis import FOLDER, TRUTH, DiagnosisResult
from rig.results.fit import FitResult
from rig.results.tables import track_parts
from rig.results.tracking import LoopCount, TrackResult
from rig.tissue.model import load_model

PLAN = Indentation(
    name="demonstration",
    trials=2,
    air_dwell_s=0.3,
    approach_speed_mm_s=6.0,
    hold_s=0.4,
    dither_amplitude_mm=0.3,
    dither_s=0.4,
    retract_speed_mm_s=20.0,
    clearance_mm=4.0,
    rest_s=0.1,
)
LARGEST_SEED = 100_000
FORCES_N = (1.0, 2.0, 3.0, 4.0, 5.0)
SECONDS = 3.0
MODEL = Path("fit") / "model.json"
SUMMARY, REPORT, SESSION = "summary.json", "report.html", "session"
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
) -> None:
    """Does the whole job on the mock bench: capture, fit, track, diagnose, verify, report, and the truth at the end.

    Example: rig demo --out demo
    """
    session, wiring = out / SESSION, built_in()
    plan = PLAN if protocol is None else load(Indentation, protocol)
    plan = plan.model_copy(update={"trials": trials or plan.trials})
    experiment.check(plan, wiring)
    _clear(out)
    seed = secrets.randbelow(LARGEST_SEED) if seed is None else seed
    secret = draw(np.random.default_rng(seed), plan)
    show(f"a cause is hidden in the bench; --seed {seed} hides the same again")
    with bench_for(wiring, secret.hide) as (live_wiring, _), live.connected(live_wiring) as bench:
        console.rule(f"capture: {len(plan.speeds_mm_s)} speeds, {plan.trials} trials each")
        captured(bench, plan, session)
        console.rule("fit: constant stiffness against the index law")
        fitted = fit_session([session])
        console.rule("track: gains from the tangent stiffness of the model")
        result = _track(bench, session)
    show(*track_parts(result))
    console.rule("diagnose: what the simulation gets wrong")
    diagnosis = diagnosed(session, out=session / FOLDER)
    console.rule("verify and report")
    counts = _verified(session)
    derive(session)
    write_text(session / FOLDER / TRUTH, secret.sentence(diagnosis) + "\n")
    write_report(session, out / REPORT)
    _summary(counts, fitted, result, _diagnosis(diagnosis, secret, seed)).write(out / SUMMARY)
    show(f"{counts.recordings} recordings, {counts.samples} samples, {counts.dropped} dropped")
    show(f"{out / REPORT} shows it; {out / SUMMARY} has the figures")
    console.rule("the truth")
    show(secret.sentence(diagnosis))


def _clear(out: Path) -> None:
    """Removes an earlier demonstration, and nothing else."""
    strangers = (
        [path.name for path in out.iterdir() if path.name not in (SUMMARY, REPORT, SESSION)] if out.exists() else []
    )
    if strangers:
        raise UsageError(
            f"{out}: holds {', '.join(sorted(strangers))}, which no demonstration made; give another folder"
        )
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)


def _track(bench: Supervisor, session: Path) -> TrackResult:
    model = load_model(session / MODEL)
    program = tracked.plan(forces_within(model.valid.force_N), SECONDS, model, bench.wiring)
    return followed(bench, TrackPlan(program, str(MODEL)), session)


def forces_within(largest_N: float) -> tuple[float, ...]:
    """1 to 5 N; where the model was fitted to less, five steps that leave it room at the end."""
    if largest_N >= FORCES_N[-1]:
        return FORCES_N
    return tuple(round(force_N / FORCES_N[-1] * 0.85 * largest_N, 2) for force_N in FORCES_N)


def _diagnosis(result: DiagnosisResult, secret: HiddenCause, seed: int) -> DemoDiagnosis:
    """What was said, and last what is true."""
    return DemoDiagnosis(
        verdict=result.verdict,
        statement=result.statement,
        findings=result.findings,
        named=any(secret.effect in finding.effects for finding in result.findings),
        seed=seed,
        truth=HiddenTruth(effect=secret.effect, parameters=secret.knobs),
    )


def _verified(session: Path) -> RecordingCounts:
    """Raises CheckFailed where a recording is not complete."""
    opened = open_session(session)
    verdicts = [verify(opened.path(trial.name)) for trial in opened.trials]
    bad = [verdict.sentence for verdict in verdicts if not verdict.ok]
    if bad:
        raise CheckFailed("; ".join(bad))
    loops = [opened.recording(trial.name).tables["loop"] for trial in opened.trials]
    return RecordingCounts(
        recordings=len(verdicts),
        samples=sum(stream.samples for verdict in verdicts for stream in verdict.streams.values()),
        dropped=sum(stream.dropped for verdict in verdicts for stream in verdict.streams.values()),
        loop=LoopCount(
            ticks=sum(len(rows) for rows in loops),
            missed=sum(int(rows["missed"][-1] - rows["missed"][0]) for rows in loops),
        ),
    )


def _summary(
    counts: RecordingCounts, fitted: FitResult, tracking: TrackResult, diagnosis: DemoDiagnosis
) -> DemoSummary:
    return DemoSummary(**dict(counts), fit=fitted, tracking=DemoTracking.model_validate(tracking), diagnosis=diagnosis)
