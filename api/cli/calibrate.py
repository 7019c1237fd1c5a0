"""`rig calibrate`: force sensor against known weights, axis against tracker or gauge block."""

import os
from pathlib import Path
from typing import Annotated, Literal

import typer

from api.cli.asking import Person
from api.cli.calibrate_axis import calibrate_axis
from api.cli.calibrate_dynamics import calibrate_dynamics
from api.cli.calibrate_force import ForceAsked, Load, calibrate_force
from api.cli.calibrate_glove import GloveAsked, calibrate_glove, keep_and_say
from api.cli.options import ConfigOption, JsonOption, SetOption, wiring_file, wiring_from
from api.cli.output import show, write_json
from api.operations.calibrate import AxisAsked
from api.operations.calibrations import kept, refuse_out
from rig.config.calibration import AnyCalibration, What, what_of
from rig.errors import UsageError

OF_FORCE = ("weights", "load", "tolerance_percent", "gravity")
OF_AXIS = ("from_mm", "to_mm", "clear", "toward_limb", "gauge_block_mm", "near_mm", "dynamics")
OF_SCALE = ("to_mm", "toward_limb", "gauge_block_mm", "near_mm")
OTHERS = {"force": (*OF_AXIS, "input_name"), "axis": (*OF_FORCE, "input_name"), "glove": (*OF_AXIS, "load")}
WeightsOption = Annotated[
    str, typer.Option("--weights", help="force: known weights, as '100 g,200 g,5 N'; a mock sensor has its own.")
]
ToleranceOption = Annotated[
    float, typer.Option("--tolerance-percent", min=0, max=10, help="force: bound on the error of each weight.")
]
GravityOption = Annotated[
    float | None, typer.Option("--gravity", min=9.7, max=9.9, help="force: m/s2 at this place, for g and kg.")
]
TowardOption = Annotated[
    bool | None, typer.Option("--toward-limb/--away-from-limb", help="axis: where the tip went at first.")
]
BlockOption = Annotated[
    float | None, typer.Option("--gauge-block-mm", min=1, max=100, help="axis: against a block, not the tracker.")
]
NearOption = Annotated[
    float | None, typer.Option("--near-mm", help="axis: position just before the table, for the block.")
]
DynamicsOption = Annotated[
    bool, typer.Option("--dynamics", help="axis: how it follows its set-point, by small sweeps in the air.")
]
PauseOption = Annotated[
    float | None, typer.Option("--pause", min=0, max=600, help="Seconds to wait instead of Enter each time.")
]


def calibrate(
    context: typer.Context,
    what: Annotated[Literal["force", "axis", "glove"], typer.Argument(help="What to calibrate.")],
    weights: WeightsOption = "",
    load: Annotated[Load | None, typer.Option("--load", help="force: pressed on the tip, or hung.")] = None,
    tolerance_percent: ToleranceOption = 0.5,
    gravity: GravityOption = None,
    from_mm: Annotated[float, typer.Option("--from-mm", help="axis: where it begins, in the air.")] = 2.0,
    to_mm: Annotated[float, typer.Option("--to-mm", help="axis: how far it goes, in the air.")] = 14.0,
    clear: Annotated[bool, typer.Option("--clear", help="axis: the tip's way is free, and the limb out.")] = False,
    toward_limb: TowardOption = None,
    gauge_block_mm: BlockOption = None,
    near_mm: NearOption = None,
    input_name: Annotated[str, typer.Option("--input", help="glove: its name, where there are several.")] = "",
    dynamics: DynamicsOption = False,
    pause: PauseOption = None,
    out: Annotated[Path | None, typer.Option("--out", help="New file; else calibration/WHAT-SERIAL-TIME.json.")] = None,
    config: ConfigOption = None,
    overrides: SetOption = None,
    json_file: JsonOption = None,
) -> None:
    """Calibrates force sensor or glove (known weights) or axis (tracker, block, sweeps); says what is wrong with it.

    force: nothing moves; unloaded, each weight up and down again, unloaded, step by step. axis: the tip moves in the
    air between rests; with --dynamics it swings by less than a millimetre, and what a force loop needs to know of the
    axis is found. What contradicts the configuration is refused, never corrected, and then nothing is written.

    Example: rig calibrate force --weights "100 g,200 g,500 g" --load pressed
    """
    _refuse_options(context, OTHERS[what], what)
    wiring, person = wiring_from(config, overrides), Person(pause)
    refuse_out(out)
    if what == "glove":
        of_glove = GloveAsked(weights, tolerance_percent / 100, gravity, input_name)
        keep_and_say(*calibrate_glove(wiring, of_glove, person), out, config, json_file)
        return
    found: AnyCalibration
    if dynamics:
        _refuse_options(context, OF_SCALE, "axis --dynamics")
        found = calibrate_dynamics(wiring, from_mm, clear, person)
    elif what == "force":
        found = calibrate_force(wiring, ForceAsked(weights, load, tolerance_percent / 100, gravity), person)
    else:
        way = AxisAsked(from_mm, to_mm, clear, toward_limb, gauge_block_mm, near_mm)
        found = calibrate_axis(wiring, way, person)
    result = kept(wiring.calibration, found, out)
    say_use(what_of(found), Path(result.file), (wiring_file(config) or Path()).parent)
    write_json(json_file, result)


def say_use(what: What, path: Path, wiring_folder: Path) -> None:
    """Where it is, and the lines of the wiring file that name it."""
    named = os.path.relpath(path, wiring_folder)
    show(f"written: {path}; the lines of rig.toml that use it:", f'[calibration]\n{what} = "{named}"')


def _refuse_options(context: typer.Context, others: tuple[str, ...], what: str) -> None:
    """An option that would not count is told."""
    for name in others:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            raise UsageError(f"--{name.replace('_', '-')} says nothing to `rig calibrate {what}`; leave it out")
