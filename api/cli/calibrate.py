"""`rig calibrate`: force sensor against known weights, axis against tracker or gauge block."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from api.cli.asking import Person
from api.cli.calibrate_force import ForceAsked, Load, calibrate_force
from api.cli.calibration_output import keep, refuse_unwritable
from api.cli.options import ConfigOption, JsonOption, SetOption, wiring_file, wiring_from
from api.cli.output import write_json


def calibrate(
    what: Annotated[Literal["force"], typer.Argument(help="What to calibrate.")],
    weights: Annotated[
        str, typer.Option("--weights", help="Known weights, as '100 g,200 g,5 N'; a mock sensor has its own.")
    ] = "",
    load: Annotated[Load | None, typer.Option("--load", help="How weights act: pressed on the tip, or hung.")] = None,
    tolerance_percent: Annotated[
        float, typer.Option("--tolerance-percent", min=0, max=10, help="Bound on the error of each weight.")
    ] = 0.5,
    gravity: Annotated[
        float | None, typer.Option("--gravity", min=9.7, max=9.9, help="m/s2 at this place, for weights in g and kg.")
    ] = None,
    pause: Annotated[
        float | None, typer.Option("--pause", min=0, max=600, help="Seconds to wait instead of Enter each time.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="New file; else calibration/WHAT-SERIAL-TIME.json.")] = None,
    config: ConfigOption = None,
    overrides: SetOption = None,
    json_file: JsonOption = None,
) -> None:
    """Calibrates the force sensor with known weights, and says what is wrong instead of correcting it.

    Nothing moves. Unloaded, each weight up and down again, unloaded: guided step by step. Nothing is written where
    direction, channel, gain, cross-talk, range, zero or a weight does not fit.

    Example: rig calibrate force --weights "100 g,200 g,500 g" --load pressed
    """
    wiring = wiring_from(config, overrides)
    refuse_unwritable(out)
    asked = ForceAsked(weights, load, tolerance_percent / 100, gravity)
    found = calibrate_force(wiring, asked, Person(pause))
    path = keep(what, found, out, (wiring_file(config) or Path()).parent)
    write_json(json_file, {"file": str(path), **found.model_dump(mode="json")})
