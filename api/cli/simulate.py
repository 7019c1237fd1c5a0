"""`rig simulate`: a reference on a tissue model, before anything real moves."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from api.cli.options import ConfigOption, JsonOption, SetOption, wiring_from
from api.cli.output import console, say, show, write_json
from controller.experiments import comparison, tracked, tracking
from controller.experiments.references import named
from controller.law.force_position import GainRow
from controller.law.gains import Choice, margins
from controller.loop.modes import Mode
from controller.loop.steps import TrackForce
from controller.simulated import bench as simulated
from controller.simulated.bench import SimulatedBench, Trace, limb_of
from rig.config.wiring import Wiring
from rig.errors import DataError
from rig.results.tables import margin_table, simulation_sentence
from rig.results.tracking import Jump, LoopMargins, SimulateResult
from rig.tissue.model import Model, load_model

PLAYS = 3
SHOWN_N = (0.5, 1.0, 2.0, 5.0, 10.0)


def simulate(
    model: Annotated[Path, typer.Option("--model", help="model.json as `rig fit` writes it.")],
    reference: Annotated[
        str, typer.Option("--reference", help="step:5, ramp:5, stairs:10, sine:0.5, press:3, knead:3, csv:FILE, ...")
    ],
    gains: Annotated[
        str, typer.Option("--gains", help="tangent, secant, constant or admittance; else loop.gains.")
    ] = "",
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
    wiring, fitted, asked = wiring_from(config, overrides), load_model(model), named(reference)
    choice = comparison.choice_from(gains) if gains else wiring.loop.gains
    program = tracked.plan_reference(asked, fitted, wiring, choice)
    bench = SimulatedBench(limb_of(fitted, stiffness, breathing))
    trace, times_real_time = _timed(lambda: simulated.run(program, wiring, bench))
    result = _result(trace, times_real_time, asked.name, choice, _margins(fitted, wiring, choice, stiffness))
    show(margin_table(result.margins))
    say([simulation_sentence(result)])
    _draw(trace, bench, out, f"{asked.name}, {choice} gains")
    _draw_bode(fitted, wiring, choice, stiffness, out)
    console.print(f"simulation.svg, simulation.png and bode.svg are in {out}", highlight=False)
    write_json(json_file, result)


def _timed(play: Callable[[], Trace]) -> tuple[Trace, float]:
    """The trace, and how many times faster than real time the best of PLAYS was, after one that compiles.

    By processor time: what else the computer does meanwhile says nothing of the simulation.
    """
    trace, took_s = play(), []
    for _ in range(PLAYS):
        began = time.process_time()
        play()
        took_s.append(time.process_time() - began)
    return trace, float(trace.time_s[-1] / min(took_s))


def _result(
    trace: Trace, times_real_time: float, reference: str, choice: Choice, loop: Sequence[LoopMargins]
) -> SimulateResult:
    on = (trace.mode == Mode.CONTACT) & np.isfinite(trace.reference_N)
    return SimulateResult(
        reference=reference,
        gains=choice,
        times_real_time=times_real_time,
        jumps=_jumps(trace),
        duration_s=float(trace.time_s[-1]),
        rms_error_N=float(np.sqrt(np.mean((trace.force_N[on] - trace.reference_N[on]) ** 2))),
        peak_force_N=float(np.max(trace.force_N)),
        largest_voltage_V=float(np.max(np.abs(trace.voltage_V[on]))),
        margins=tuple(loop),
    )


def _jumps(trace: Trace) -> tuple[Jump, ...]:
    """What a jump of the reference leads to; none where it has no jump."""
    try:
        return comparison.jumps(trace.time_s, trace.reference_N, trace.sensed_N, trace.mode)
    except DataError:
        return ()


def _law(model: Model, wiring: Wiring, choice: Choice) -> TrackForce:
    return tracking.force_law(model, wiring, choice, adapt=False)


def _margins(model: Model, wiring: Wiring, choice: Choice, stiffness: float) -> list[LoopMargins]:
    """Margins with the gains of each force, on tissue ``stiffness`` times as stiff as the model."""
    design, found = tracking.design_for(wiring), []
    for row in _shown(model, wiring, choice):
        tangent = stiffness * model.tangent_N_mm(model.depth_mm(row.force_N))
        loop = margins((row.proportional_mm_N, row.integral_mm_N_s), tangent, model.damping_N_s_mm, design)
        found.append(LoopMargins(force_N=row.force_N, tangent_N_mm=tangent, **loop._asdict()))
    return found


def _shown(model: Model, wiring: Wiring, choice: Choice) -> list[GainRow]:
    rows = _law(model, wiring, choice).gains
    forces = [force for force in SHOWN_N if force <= model.valid.force_N]
    return [min(rows, key=lambda row: abs(row.force_N - force)) for force in forces]


def _draw(trace: Trace, bench: SimulatedBench, out: Path, title: str) -> None:
    from rig.report.control_figures import Signals, run_figure  # noqa: PLC0415 - drawing takes a second to load
    from rig.report.drawing import png, svg  # noqa: PLC0415

    on = trace.mode == Mode.CONTACT
    time_s = trace.time_s[on]
    figure = run_figure(
        Signals(
            time_s - time_s[0], trace.reference_N[on], trace.force_N[on],
            trace.position_mm[on] - bench.limb.surface_mm, trace.current_A[on], trace.voltage_V[on],
        ),
        title,
    )  # fmt: skip
    out.mkdir(parents=True, exist_ok=True)
    (out / "simulation.svg").write_text(svg(figure))
    (out / "simulation.png").write_bytes(png(figure))


def _draw_bode(model: Model, wiring: Wiring, choice: Choice, stiffness: float, out: Path) -> None:
    from controller.law import transfer_functions  # noqa: PLC0415 - python-control loads slowly
    from rig.report.control_figures import bode_figure  # noqa: PLC0415
    from rig.report.drawing import svg  # noqa: PLC0415

    design, curves = tracking.design_for(wiring), {}
    for row in _shown(model, wiring, choice):
        tangent = stiffness * model.tangent_N_mm(model.depth_mm(row.force_N))
        loop = transfer_functions.bode(transfer_functions.open_loop(row, tangent, model.damping_N_s_mm, design))
        curves[f"{row.force_N:.1f} N"] = (loop.frequency_Hz, loop.gain, loop.phase_deg)
    (out / "bode.svg").write_text(svg(bode_figure(curves)))
