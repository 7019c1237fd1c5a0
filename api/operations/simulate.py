"""A reference on a tissue model, before anything real moves."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.experiments import comparison, tracked, tracking
from controller.experiments.references import Reference
from controller.law.force_position import GainRow
from controller.law.gains import Choice, margins
from controller.loop.modes import Mode
from controller.loop.steps import TrackForce
from controller.operation import Operation
from controller.simulated import bench as simulated
from controller.simulated.bench import SimulatedBench, Trace, limb_of
from rig.config.wiring import Wiring
from rig.errors import DataError
from rig.recording.files import make_folder, write_text
from rig.results.tracking import Jump, LoopMargins, SimulateResult
from rig.tissue.model import Model

PLAYS = 3
SHOWN_N = (0.5, 1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True)
class SimulatedRun:
    """What is played: a reference, with gains from a model, on tissue that may be stiffer and may breathe [mm]."""

    reference: Reference
    model: Model
    gains: Choice
    stiffness: float = 1.0
    breathing_mm: float = 0.0


def simulate(operation: Operation, wiring: Wiring, wanted: SimulatedRun, out: Path) -> SimulateResult:
    """Plays it on a virtual clock with the loop's own code, and draws force, displacement and effort into ``out``."""
    model, choice, stiffness = wanted.model, wanted.gains, wanted.stiffness
    program = tracked.plan_reference(wanted.reference, model, wiring, choice)
    bench = SimulatedBench(limb_of(model, stiffness, wanted.breathing_mm))
    trace, times_real_time = _timed(operation, lambda: simulated.run(program, wiring, bench))
    loop = _margins(model, wiring, choice, stiffness)
    result = _result(trace, times_real_time, wanted.reference.name, choice, loop)
    make_folder(out)
    _draw(trace, bench, out, f"{wanted.reference.name}, {choice} gains")
    _draw_bode(model, wiring, choice, stiffness, out)
    return result


def _timed(operation: Operation, play: Callable[[], Trace]) -> tuple[Trace, float]:
    """The trace, and how many times faster than real time the best of PLAYS was, after one that compiles.

    By processor time: what else the computer does meanwhile says nothing of the simulation.
    """
    operation.step("compiling", 0.0)
    trace, took_s = play(), []
    for number in range(PLAYS):
        operation.step(f"playing, {number + 1} of {PLAYS}", (1 + number) / (1 + PLAYS))
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
    from rig.report.drawing import save_figure  # noqa: PLC0415

    on = trace.mode == Mode.CONTACT
    time_s = trace.time_s[on]
    figure = run_figure(
        Signals(
            time_s - time_s[0], trace.reference_N[on], trace.force_N[on],
            trace.position_mm[on] - bench.limb.surface_mm, trace.current_A[on], trace.voltage_V[on],
        ),
        title,
    )  # fmt: skip
    save_figure(figure, out, "simulation")


def _draw_bode(model: Model, wiring: Wiring, choice: Choice, stiffness: float, out: Path) -> None:
    from controller.law import transfer_functions  # noqa: PLC0415 - python-control loads slowly
    from rig.report.control_figures import bode_figure  # noqa: PLC0415
    from rig.report.drawing import svg  # noqa: PLC0415

    design, curves = tracking.design_for(wiring), {}
    for row in _shown(model, wiring, choice):
        tangent = stiffness * model.tangent_N_mm(model.depth_mm(row.force_N))
        loop = transfer_functions.bode(transfer_functions.open_loop(row, tangent, model.damping_N_s_mm, design))
        curves[f"{row.force_N:.1f} N"] = (loop.frequency_Hz, loop.gain, loop.phase_deg)
    write_text(out / "bode.svg", svg(bode_figure(curves)))
