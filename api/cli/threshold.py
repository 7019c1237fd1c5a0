"""`rig threshold`: the force at which the subject stops a slow ramp."""

from pathlib import Path
from typing import Annotated

import typer

from api.cli import live
from api.cli.glove import by_glove
from api.cli.options import ConfigOption, JsonOption, SetOption, calibrated, wiring_from
from api.cli.output import show, write_json
from api.operations import motion
from api.operations.motion import TrackPlan
from controller.commissioning.dynamics_refusals import refuse_unidentified
from controller.experiments import threshold as experiment
from controller.experiments import tracked
from controller.operation import Operation
from rig.errors import UsageError
from rig.tissue.model import load_model


def threshold(
    model: Annotated[Path | None, typer.Option("--model", help="Model of the ramp's gains, by `rig fit`.")] = None,
    up_to: Annotated[float | None, typer.Option("--up-to", help="Force in N at which the ramp ends.")] = None,
    rate: Annotated[float, typer.Option("--rate", help="How fast force rises, N/s.")] = 0.5,
    out: Annotated[Path, typer.Option("--out", help="Session folder of the recording; new or existing.")] = Path(
        "threshold"
    ),
    glove: Annotated[bool, typer.Option("--glove", help="By three presses with a glove; the axis stays off.")] = False,
    input_name: Annotated[str, typer.Option("--input", help="The glove's name, where there are several.")] = "",
    config: ConfigOption = None,
    overrides: SetOption = None,
    json_file: JsonOption = None,
) -> None:
    """Raises force slowly until the subject presses p, and prints the line of `rig.toml` that keeps it.

    With --glove somebody presses with the glove instead, three times at subject.site, until the subject says stop.

    Example: rig threshold --model sessions/first/fit/model.json --up-to 10
    """
    wiring = wiring_from(config, overrides)
    if glove:
        by_glove(wiring, input_name, out, json_file)
        return
    if model is None or up_to is None:
        raise UsageError("rig threshold: give --model and --up-to for a ramp of the axis, or --glove")
    fitted = load_model(model)
    experiment.plan(up_to, rate, fitted, wiring)  # refused before anything is opened
    refuse_unidentified(calibrated(wiring))
    tracked.refuse_foreign(out)
    with live.running(wiring) as bench:
        ramp = TrackPlan(experiment.plan(up_to, rate, fitted, bench.wiring), str(model))
        operation = Operation("threshold", total=1, unit="ramps")
        found = live.run(bench, operation, lambda: motion.threshold(operation, bench, ramp, up_to, out))
    if found.force_N is None:
        show(f"no pain stop up to {up_to:g} N: the threshold lies above")
    else:
        show(f"[subject]\npain_threshold_N = {found.force_N:.1f}")
    write_json(json_file, found)
