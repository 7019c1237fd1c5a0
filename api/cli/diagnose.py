"""Commands that criticise: what a session shows of the simulation's errors, and what a protocol could show."""

import json
from collections.abc import Iterator, Mapping
from itertools import chain, repeat
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from api.cli.options import JsonOption
from api.cli.output import console, table, write_json
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.diagnosis.answers import Answer, Diagnosis
from rig.diagnosis.design import check
from rig.diagnosis.extended import extended_model
from rig.diagnosis.files import FOLDER, MODEL, PICTURES, RESULT
from rig.diagnosis.gates import Finding
from rig.diagnosis.run import diagnose_session
from rig.diagnosis.simulated import Simulated
from rig.diagnosis.sources import read_source
from rig.errors import UsageError
from rig.recording.files import write_text
from rig.recording.sessions import SESSION_FILE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", 2019: symmetric model, closed-loop simulation.
PUBLISHED = {"DATA_EMPS": "; published 5.85 %", "DATA_EMPS_PULSES": "; published 8.94 %"}
Simulation = Literal["index", "constant", "axis"]


def diagnose(
    session: Annotated[Path, typer.Argument(help="Session folder, or a folder of CSV files as `rig import` reads it.")],
    simulation: Annotated[Simulation, typer.Option(help="Which simulation is judged.")] = "index",
    columns: Annotated[list[str] | None, typer.Option(help="[STREAM.]FIELD=HEADER for other column names.")] = None,
    only: Annotated[
        str, typer.Option("--only", help="Of recordings stacked in one CSV file: those matching, for example 'pork*'.")
    ] = "",
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for pictures and the extended model; else SESSION/diagnosis.")
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Says what the simulation gets wrong on a session, names the cause, extends the model and measures the gain.

    Example: rig diagnose sessions/first --json diagnosis.json
    """
    result = run_diagnosis(session, simulation, tuple(columns or ()), only)
    show(result)
    write_json(json_file, result.as_json())
    folder = session / FOLDER if out is None and (session / SESSION_FILE).exists() else out
    if folder is not None:
        save(result, folder)


def protocol(
    action: Annotated[Literal["check"], typer.Argument(help="What to do with the protocol.")],  # noqa: ARG001 - a verb
    file: Annotated[Path, typer.Argument(help="Protocol file, for example examples/diagnosis.toml.")],
    tracker: Annotated[bool, typer.Option(help="Whether a tracker sees the tip.")] = True,
    rate_hz: Annotated[
        float, typer.Option("--rate-Hz", min=10, max=100_000, help="Rate of the force sensor.")
    ] = 1000.0,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the confusability picture.")] = None,
    json_file: JsonOption = None,
) -> None:
    """Says before any recording which causes a protocol can show, from what size, and which it cannot separate.

    Example: rig protocol check examples/diagnosis.toml --json check.json
    """
    result = check(load(Indentation, file), tracker, rate_hz)
    console.print(f"{result.cycles} cycles in {result.duration_s:.0f} s", highlight=False)
    seen = [(name, measured(size, unit)) for name, (size, unit) in sorted(result.detectable.items())]
    console.print(table(("cause", "visible from"), seen, "On a limb and noise as the mock bench has them"))
    for reason, names in by_reason(result.not_testable):
        console.print(f"cannot be seen: {names}: {reason}", highlight=False, markup=False)
    rows = [(one, other, f"{left:.1f}") for one, other, left in result.pairs]
    if rows:
        console.print(table(("cause", "imitated by", "nats left of 50"), rows, "Hard to separate (safe from 20)"))
    write_json(json_file, result.as_json())
    if out is not None:
        from rig.report.diagnosis_figures import confusability_figure  # noqa: PLC0415 - matplotlib takes a second

        draw({"confusability": confusability_figure(result.names, result.confusion)}, out)


def run_diagnosis(folder: Path, simulation: Simulation, columns: tuple[str, ...] = (), only: str = "") -> Diagnosis:
    """The diagnosis of a folder, with a progress bar on stderr."""
    bar_columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    screen = Console(stderr=True)
    with Progress(*bar_columns, console=screen, disable=not screen.is_terminal, transient=True) as bar:
        task = bar.add_task("reading", total=1.0)

        def progress(text: str, done: float) -> None:
            bar.update(task, description=text, completed=done)

        if simulation == "axis":
            # The axis needs none of the tissue's machinery, and the tissue none of the axis'.
            from rig.diagnosis.axis_run import diagnose_axis_folder  # noqa: PLC0415

            return diagnose_axis_folder(folder, progress)
        return diagnose_session(read_source(folder, columns, only), simulation, progress)


def show(result: Diagnosis) -> None:
    """The diagnosis for a person."""
    console.print(f"{result.verdict}: {result.statement}", highlight=False, markup=False)
    if result.findings:
        _show_named(result)
    seen = [(name, measured(size, unit)) for name, (size, unit) in sorted(result.detectable.items())]
    if seen:
        console.print(table(("cause", "would have been named from"), seen, "Not found"))
    said = [f"cannot be tested: {names}: {reason}" for reason, names in by_reason(result.not_testable)]
    if result.search is None:
        said = [f"cannot be tested: any of the {len(result.not_testable)} causes, for this reason"]
    said += [_in_closed_loop(item) for item in result.simulated]
    said += [_of_the_data(finding) for finding in result.quality]
    said += [f"next experiment: {after(result.next_experiment)}"] if result.next_experiment else []
    for sentence in said:
        console.print(sentence, highlight=False, markup=False)


def _show_named(result: Diagnosis) -> None:
    rows = [
        (cause, name, f"{found.value:.4g}", f"{found.low:.4g} to {found.high:.4g}{', at its bound' * found.at_bound}")
        for finding in result.findings
        for cause, (name, found) in zip(_once(" or ".join(finding.effects)), finding.parameters.items(), strict=False)
    ]
    title = "Named" if result.verdict == "explained" else "Named provisionally"
    console.print(table(("cause", "parameter", "value", "95 % interval"), rows, title))
    for finding in result.findings:
        console.print(f"{finding.effects[0]}: {_gained(finding)}; {finding.repair}", highlight=False, markup=False)


def _once(text: str) -> Iterator[str]:
    """``text``, then nothing for ever: a name beside the first of its rows."""
    return chain([text], repeat(""))


def _gained(finding: Answer) -> str:
    gain, less = finding.gain, finding.gain.reduction
    return (
        f"error on recordings left out {gain.before:.4f} -> {gain.after:.4f} {gain.unit} "
        f"({100 * less.value:.0f} % less, {100 * less.low:.0f} to {100 * less.high:.0f}), {finding.nats:.0f} nats"
    )


def _of_the_data(finding: Finding) -> str:
    others = f" (and in {finding.recordings - 1} more)" if finding.recordings > 1 else ""
    return f"data: {f'{finding.recording} ' if finding.recording else ''}{finding.text}{others}"


def _in_closed_loop(item: Simulated) -> str:
    which = "fitted" if item.fitted else "left out"
    return (
        f"closed-loop force error, {item.recording} ({which}): "
        f"{item.before_percent:.2f} % -> {item.after_percent:.2f} %{PUBLISHED.get(item.recording, '')}"
    )


def measured(size: float, unit: str) -> str:
    """A size with its unit, where it has one."""
    return f"{size:.3g} {unit}" if unit != "1" else f"{size:.3g}"


def by_reason(reasons: Mapping[str, str]) -> list[tuple[str, str]]:
    """Each reason once, with the causes it holds for."""
    return [
        (reason, ", ".join(sorted(name for name, why in reasons.items() if why == reason)))
        for reason in dict.fromkeys(reasons.values())
    ]


def after(experiment: Mapping[str, object]) -> str:
    """The next experiment as a sentence."""
    rate, pair = experiment.get("nats_per_minute"), experiment.get("separates")
    if not isinstance(rate, float) or not isinstance(pair, list):
        return str(experiment.get("do"))
    return f"{experiment.get('do')}, which separates {' from '.join(map(str, pair))} at {rate:.1f} nats a minute"


def save(result: Diagnosis, folder: Path) -> None:
    """``diagnosis.json``, pictures, and the extended model where there is one, in ``folder``."""
    from rig.report.diagnosis_figures import pictures  # noqa: PLC0415 - matplotlib takes a second to load

    for old in (folder / MODEL, *(folder / f"{name}{kind}" for name in PICTURES for kind in (".svg", ".png"))):
        old.unlink(missing_ok=True)
    figures = pictures(result)
    draw(figures, folder)
    write_text(folder / RESULT, json.dumps(result.as_json(), indent=2) + "\n")
    said = f"pictures and {RESULT} are in {folder}" if figures else f"{folder / RESULT} is written"
    console.print(said, highlight=False)
    if result.search is not None and result.simulation != "axis":
        model = extended_model(result)
        model.save(folder / MODEL)
        what = "extended model" if model.effects else "simulation's own model, with nothing added,"
        console.print(f"{folder / MODEL} is the {what} for rig track, simulate and fit --with", highlight=False)
        for effect in model.effects:
            console.print(f"  {effect.name}: {effect.used}", highlight=False)


def draw(figures: Mapping[str, "Figure"], folder: Path) -> None:
    """Each figure as PNG and SVG in ``folder``, which is made."""
    from rig.report.drawing import png, svg  # noqa: PLC0415 - matplotlib takes a second to load

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be made: {error.strerror}; give another --out") from error
    for name, picture in figures.items():
        (folder / f"{name}.png").write_bytes(png(picture))
        write_text(folder / f"{name}.svg", svg(picture))
