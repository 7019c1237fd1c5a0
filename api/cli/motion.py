"""Commands that move: capture and track."""

import math
from datetime import datetime
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from api.cli import live
from api.cli.options import ConfigOption, JsonOption, SetOption, wiring_from
from api.cli.output import console, table, write_json
from api.cli.stage import bench_for
from controller.experiments import capture as experiment
from controller.experiments import tracked
from controller.experiments.comparison import CHOICES, choice_from, choices_from
from controller.experiments.references import named
from controller.experiments.tracked import Tracked
from controller.experiments.verdicts import refuse_bad
from controller.loop.steps import Program
from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.recording.sessions import SessionInfo, TrialInfo, plain
from rig.tissue.model import load_model

Out = Annotated[Path, typer.Option("--out", help="New folder for the session.")]


def capture(
    protocol: Annotated[Path, typer.Argument(help="Protocol file, for example examples/indentation.toml.")],
    out: Out,
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
    with bench_for(wiring) as (live_wiring, _), live.connected(live_wiring) as bench:
        info = captured(bench, plan, out)
    write_json(json_file, summary(info, out))
    refuse_bad(info)


def captured(bench: Supervisor, plan: Indentation, out: Path) -> SessionInfo:
    """The session, with progress on the terminal and a summary line a trial."""
    total = len(plan.speeds_mm_s) * plan.trials
    operation = Operation("capture", total=total, unit="trials")
    return live.run(bench, operation, lambda: experiment.capture(bench, plan, out, operation, _say))


def _say(trial: TrialInfo) -> None:
    samples, dropped = sum(trial.samples.values()), sum(trial.dropped.values())
    console.print(
        f"{trial.name}  {trial.speed_mm_s:5g} mm/s  {_surface(trial)}  peak {trial.peak_force_N:6.2f} N"
        f"  {samples:7d} samples  {dropped} dropped  {trial.outcome}  {trial.quality}",
        highlight=False,
        soft_wrap=True,
    )
    for reason in trial.reasons:
        console.print(f"    {reason}", highlight=False, markup=False, soft_wrap=True)


def _surface(trial: TrialInfo) -> str:
    """Where the surface was found, and how far its 95 % interval reaches."""
    within_mm = max(trial.surface_high_mm - trial.surface_mm, trial.surface_mm - trial.surface_low_mm)
    return "no surface" if math.isnan(trial.surface_mm) else f"surface {trial.surface_mm:6.2f} +-{within_mm:.2f} mm"


def summary(info: SessionInfo, folder: Path) -> dict[str, object]:
    """The result of a capture as JSON."""
    return {
        "session": str(folder),
        "recordings": len(info.trials),
        "samples": sum(sum(trial.samples.values()) for trial in info.trials),
        "dropped": sum(sum(trial.dropped.values()) for trial in info.trials),
        "trials": [
            {
                "name": t.name,
                "speed_mm_s": t.speed_mm_s,
                "outcome": t.outcome,
                "peak_force_N": t.peak_force_N,
                "quality": t.quality,
                "reasons": list(t.reasons),
                "measured": plain(t.measured),
                "repeats": t.repeats,
                "surface_mm": plain([t.surface_mm, t.surface_low_mm, t.surface_high_mm]),
            }
            for t in info.trials
        ],
    }


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
    gains: Annotated[
        str, typer.Option("--gains", help="tangent, secant, constant or admittance; else loop.gains.")
    ] = "",
    compare: Annotated[
        bool, typer.Option("--table", help="All gains on simulated subjects, 1 to 10 N; needs no model.")
    ] = False,
    subjects: Annotated[str, typer.Option("--subjects", help="With --table: which; else all.")] = "",
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the recording; a new or existing session.")
    ] = None,
    config: ConfigOption = None,
    overrides: SetOption = None,
    json_file: JsonOption = None,
) -> None:
    """Tracks a force with gains from a tissue model, and prints given and actual force.

    With --against the error is also measured with another model, and what the first gains over it is printed.

    Example: rig track --model sessions/first/fit/model.json --force 1,2,5 --seconds 5 --json track.json
    """
    wiring = wiring_from(config, overrides)
    asked = Asked(model, force, reference, seconds, gains, subjects)
    if compare and against:
        raise UsageError("--table learns its own models: leave out --against")
    folder = out or Path("sessions") / f"track-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    if compare:
        write_json(json_file, _compared(wiring, folder, asked))
    else:
        _tracked(wiring, folder, asked, against, json_file)


def _tracked(wiring: Wiring, folder: Path, asked: "Asked", against: Path | None, json_file: Path | None) -> None:
    """One run, after one with the other model where there is one; all is checked before anything is opened."""
    program = _planned(wiring, asked)
    other = _planned(wiring, asked._replace(model=against)) if against else None
    tracked.refuse_foreign(folder)
    with bench_for(wiring) as (live_wiring, _), live.connected(live_wiring) as bench:
        before = follow(bench, other, folder, str(against)) if other else None
        result = follow(bench, program, folder, str(asked.model))
    say_levels(result)
    say_quality(result)
    console.print(f"recorded in {folder}", highlight=False)
    write_json(json_file, tracked.as_json(result) | (say_gain(before, result) if before else {}))
    for run in (before, result):
        if run is not None:
            tracked.refuse_bad(run)


def say_quality(result: Tracked) -> None:
    """The verdict on the recording, and why it is not good."""
    console.print("quality: " + "; ".join([result.quality, *result.reasons]), highlight=False, markup=False)


def follow(bench: Supervisor, program: Program, folder: Path, model: str) -> Tracked:
    """One tracking run into ``folder``, watched on the terminal."""
    operation = Operation("track", total=1, unit="runs")
    return live.run(bench, operation, lambda: tracked.run(bench, program, folder, model, operation))


def say_gain(before: Tracked, after: Tracked) -> dict[str, object]:
    """Prints and returns what one model gains over another on the same bench and reference, jumps included."""
    old_N, new_N = before.followed.rms_error_N, after.followed.rms_error_N
    reduction = 1 - new_N / old_N
    console.print(
        f"rms error over the whole run: {old_N:.4f} N with {before.model}, {new_N:.4f} N with {after.model}"
        f" ({100 * reduction:+.0f} % less)",
        highlight=False,
    )
    gain = {"rms_error_before_N": old_N, "rms_error_after_N": new_N, "reduction": reduction}
    return {"against": tracked.as_json(before), "gain": gain}


class Asked(NamedTuple):
    """What `rig track` was asked for."""

    model: Path | None
    force: str
    reference: str
    seconds: float | None
    gains: str
    subjects: str


def _planned(wiring: Wiring, asked: Asked) -> Program:
    """The program, checked before anything is opened."""
    if asked.model is None or bool(asked.force) == bool(asked.reference) or asked.subjects:
        raise UsageError("tracking needs --model, and either --force or --reference; or --table, which has --subjects")
    fitted = load_model(asked.model)
    choice = choice_from(asked.gains) if asked.gains else None
    if asked.reference:
        if asked.seconds is not None:
            raise UsageError(
                "--seconds goes with --force; a --reference has its own duration, as in step:5,duration_s=4"
            )
        return tracked.plan_reference(named(asked.reference), fitted, wiring, choice)
    seconds = 10.0 if asked.seconds is None else asked.seconds
    return tracked.plan(tracked.forces(asked.force), seconds, fitted, wiring, choice)


def _compared(wiring: Wiring, folder: Path, asked: Asked) -> dict[str, object]:
    from api.cli import comparison  # noqa: PLC0415 - fitting is loaded only where it is used

    if asked.model or asked.reference:
        raise UsageError("--table learns its own models and jumps by itself: leave out --model and --reference")
    subjects = asked.subjects.split(",") if asked.subjects else comparison.ALL
    choices = choices_from(asked.gains) if asked.gains else CHOICES
    jumps = comparison.stairs(asked.force or "1,10", 1.5 if asked.seconds is None else asked.seconds)
    return comparison.compare(wiring, folder, subjects, choices, jumps)


def say_levels(result: Tracked) -> None:
    """The table of given and actual force."""
    if result.levels:
        console.print(table(*tracked.table(result), title="Given and actual force in N"))
    console.print(tracked.sentence(result), highlight=False)
