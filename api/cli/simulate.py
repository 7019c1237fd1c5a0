"""`rig simulate`: a reference on a tissue model, before anything real moves."""

from pathlib import Path
from typing import Annotated

import typer

from api.cli.computing import compute
from api.cli.options import ConfigOption, JsonOption, ModelOption, SetOption, wiring_from
from api.cli.output import show, write_json
from api.operations import simulate as work
from api.operations.simulate import SimulatedRun
from controller.experiments.references import parse_reference
from rig.results.tables import simulation_parts
from rig.tissue.model import load_model


def simulate(
    model: ModelOption,
    reference: Annotated[
        str, typer.Option("--reference", help="step:5, ramp:5, stairs:10, sine:0.5, press:3, knead:3, csv:FILE, ...")
    ],
    stiffness: Annotated[
        float, typer.Option("--stiffness", min=0.1, max=10.0, help="How much stiffer the tissue is than the model.")
    ] = 1.0,
    breathing: Annotated[
        float, typer.Option("--breathing", min=0.0, max=10.0, help="Amplitude in mm of the surface, at 0.25 Hz.")
    ] = 0.0,
    out: Annotated[Path, typer.Option("--out", help="Folder for the figures.")] = Path("simulation"),
    config: ConfigOption = None,
    overrides: SetOption = None,
    json_file: JsonOption = None,
) -> None:
    """Plays a reference on a virtual clock with the loop's own code, and draws force, displacement and effort.

    Example: rig simulate --model sessions/first/fit/model.json --reference step:5 --json simulation.json
    """
    wiring, fitted, asked = wiring_from(config, overrides), load_model(model), parse_reference(reference)
    wanted = SimulatedRun(asked, fitted, stiffness, breathing)
    played = compute("simulate", lambda operation: work.play(operation, wiring, wanted))
    show(*simulation_parts(played.result))
    write_json(json_file, played.result)
    played.draw(out)
    show(f"simulation.svg, simulation.png, bode.svg and nyquist.svg are in {out}")
