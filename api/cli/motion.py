"""Commands that move: capture and track."""

from datetime import datetime
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from api.cli import live
from api.cli.options import ConfigOption, JsonOption, SetOption, calibrated, wiring_from
from api.cli.output import show, write_json
from api.operations import motion
from api.operations.motion import Captured, TrackPlan
from controller.commissioning.dynamics_refusals import refuse_unidentified
from controller.experiments import capture as experiment
from controller.experiments import tracked
from controller.experiments.references import parse_reference
from controller.experiments.verdicts import refuse_bad
from controller.loop.steps import Program
from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.results.tables import track_parts
from rig.results.tracking import TrackResult
from rig.tissue.model import load_model


def capture(
    protocol: Annotated[Path, typer.Argument(help="Protocol file, for example examples/indentation.toml.")],
    out: Annotated[Path, typer.Option("--out", help="New folder for the session.")],
    config: ConfigOption = None,
    overrides: SetOption = None,
    json_file: JsonOption = None,
) -> None:
    """Runs an indentation protocol and records every trial.

    While it runs: p is the subject's pain stop, space the emergency stop, s or Ctrl-C stop and retract; what was
    recorded is kept. A bad trial is made again (quality.repeats in the protocol); exit code 4 if one stayed bad.

    Example: rig capture examples/indentation.toml --config examples/forearm.toml --out sessions/first
    """
    wiring = wiring_from(config, overrides)
    plan = load(Indentation, protocol)
    experiment.check(plan, wiring)
    experiment.refuse_used(out)
    with live.running(wiring) as bench:
        found = captured(bench, plan, out)
    write_json(json_file, found)
    refuse_bad(found.info)


def captured(bench: Supervisor, plan: Indentation, out: Path) -> Captured:
    """The session, with progress on the terminal and a summary line a trial."""
    operation = motion.capture_operation(plan)
    return live.run(bench, operation, lambda: motion.capture(operation, bench, plan, out))


def track(
    model: Annotated[Path | None, typer.Option("--model", help="model.json as `rig fit` writes it.")] = None,
    against: Annotated[
        Path | None, typer.Option("--against", help="Another model.json, tracked with first on the same bench.")
    ] = None,
    force: Annotated[str, typer.Option("--force", help="Force to track in N; several with commas.")] = "",
    reference: Annotated[
        str, typer.Option("--reference", help="Instead of --force: step:5, sine:0.5,mean_N=2, press:3, csv:FILE, ...")
    ] = "",
    seconds: Annotated[float | None, typer.Option("--seconds", help="Time on each force; else 10.")] = None,
    compare: Annotated[
        bool, typer.Option("--table", help="Jumps on simulated subjects, 1 to 10 N; needs no model.")
    ] = False,
    subjects: Annotated[str, typer.Option("--subjects", help="With --table: which; else all.")] = "",
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the recording; a new or existing session.")
    ] = None,
    config: ConfigOption = None,
    overrides: SetOption = None,
    json_file: JsonOption = None,
) -> None:
    """Tracks a force with a law made from a tissue model, and prints given and actual force.

    With --against the error is also measured with another model, and what the first gains over it is printed.

    Example: rig track --model sessions/first/fit/model.json --force 1,2,5 --seconds 5 --json track.json
    """
    wiring = wiring_from(config, overrides)
    asked = TrackOptions(model, force, reference, seconds, subjects)
    if compare and against:
        raise UsageError("--table learns its own models: leave out --against")
    folder = out or Path("sessions") / f"track-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    if compare:
        _compare(wiring, folder, asked, json_file)
    else:
        _tracked(wiring, folder, asked, against, json_file)


def _tracked(wiring: Wiring, folder: Path, asked: "TrackOptions", against: Path | None, json_file: Path | None) -> None:
    """One run, after one with the other model where there is one; all is checked before anything is opened."""
    known = calibrated(wiring)
    _plans(known, asked, against)
    refuse_unidentified(known)
    tracked.refuse_foreign(folder)
    with live.running(wiring) as bench:
        # By the axis that answered: a simulated one is identified when it is first asked for, else it is the same law.
        wanted, other = _plans(bench.wiring, asked, against)
        found = followed(bench, wanted, folder, other)
    quality = "quality: " + "; ".join([found.quality, *found.reasons])
    show(*track_parts(found), quality, f"recorded in {folder}")
    write_json(json_file, found)
    for run in (found.against, found):
        if run is not None:
            tracked.refuse_bad(run)


def _plans(wiring: Wiring, asked: "TrackOptions", against: Path | None) -> tuple[TrackPlan, TrackPlan | None]:
    """What is to be tracked, and the same with the other model."""
    other = TrackPlan(_planned(wiring, asked._replace(model=against)), str(against)) if against else None
    return TrackPlan(_planned(wiring, asked), str(asked.model)), other


def followed(bench: Supervisor, wanted: TrackPlan, folder: Path, against: TrackPlan | None = None) -> TrackResult:
    """Force tracked into ``folder``, watched on the terminal."""
    operation = Operation("track", total=2 if against else 1, unit="runs")
    return live.run(bench, operation, lambda: motion.track(operation, bench, wanted, folder, against))


class TrackOptions(NamedTuple):
    """What `rig track` was asked for."""

    model: Path | None
    force: str
    reference: str
    seconds: float | None
    subjects: str


def _planned(wiring: Wiring, asked: TrackOptions) -> Program:
    """The program, checked before anything is opened."""
    if asked.model is None or bool(asked.force) == bool(asked.reference) or asked.subjects:
        raise UsageError("tracking needs --model, and either --force or --reference; or --table, which has --subjects")
    fitted = load_model(asked.model)
    if asked.reference:
        if asked.seconds is not None:
            raise UsageError(
                "--seconds goes with --force; a --reference has its own duration, as in step:5,duration_s=4"
            )
        return tracked.plan_reference(parse_reference(asked.reference), fitted, wiring)
    seconds = 10.0 if asked.seconds is None else asked.seconds
    return tracked.plan(tracked.forces(asked.force), seconds, fitted, wiring)


def _compare(wiring: Wiring, folder: Path, asked: TrackOptions, json_file: Path | None) -> None:
    from api.cli import comparison  # noqa: PLC0415 - fitting is loaded only where it is used

    if asked.model or asked.reference:
        raise UsageError("--table learns its own models and jumps by itself: leave out --model and --reference")
    subjects = asked.subjects.split(",") if asked.subjects else comparison.ALL
    jumps = comparison.stairs(asked.force or "1,10", 1.5 if asked.seconds is None else asked.seconds)
    comparison.compare(wiring, folder, subjects, jumps, json_file)
