"""A reference on a tissue model, before anything real moves."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.experiments import comparison, tracked, tracking
from controller.experiments.references import Reference
from controller.law.axis_response import rates_of
from controller.law.loop_response import grid
from controller.law.stability import ForceLoop, nearest
from controller.loop.modes import Mode
from controller.operation import Operation
from controller.simulated import bench as simulated
from controller.simulated.bench import SENSING, SimulatedBench, Trace, limb_of
from rig.config.wiring import Wiring
from rig.errors import DataError
from rig.recording.files import make_folder, write_text
from rig.results.tracking import Jump, LoopMargins, LoopReach, SimulateResult
from rig.tissue.model import Model

PLAYS = 3
SHOWN_N = (0.5, 1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True)
class SimulatedRun:
    """What is played: a reference, with a law from a model, on tissue that may be stiffer and may breathe [mm]."""

    reference: Reference
    model: Model
    stiffness: float = 1.0
    breathing_mm: float = 0.0


@dataclass(frozen=True)
class Played:
    """A result whose figures are not drawn yet, which takes longer than all that it says."""

    result: SimulateResult
    trace: Trace
    surface_mm: float
    loops: Sequence[tuple[float, float, ForceLoop]]
    stiffness: float

    def draw(self, out: Path) -> None:
        """Force, displacement and effort, Bode and Nyquist plots."""
        make_folder(out)
        _draw(self.trace, self.surface_mm, out, self.result.reference)
        _draw_loops(self.loops, self.stiffness, out)


def simulate(operation: Operation, wiring: Wiring, wanted: SimulatedRun, out: Path) -> SimulateResult:
    """As `play`, with the figures in ``out``."""
    played = play(operation, wiring, wanted)
    played.draw(out)
    return played.result


def play(operation: Operation, wiring: Wiring, wanted: SimulatedRun) -> Played:
    """Plays it on a virtual clock with the loop's own code."""
    model, stiffness = wanted.model, wanted.stiffness
    program = tracked.plan_reference(wanted.reference, model, wiring)
    sensing = SENSING._replace(every_cycles=rates_of(wiring).every_cycles)
    bench = SimulatedBench(limb_of(model, stiffness, wanted.breathing_mm), sensing=sensing)
    trace, times_real_time = _timed(operation, lambda: simulated.run(program, wiring, bench))
    loops = _loops(model, wiring)
    result = _result(trace, times_real_time, wanted.reference.name, tracking.loop_for(model, wiring)).model_copy(
        update={"margins": tuple(_margins(force_N, tangent, loop, stiffness) for force_N, tangent, loop in loops)}
    )
    return Played(result, trace, bench.limb.surface_mm, loops, stiffness)


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


def _result(trace: Trace, times_real_time: float, reference: str, loop: ForceLoop) -> SimulateResult:
    on = (trace.mode == Mode.CONTACT) & np.isfinite(trace.reference_N)
    return SimulateResult(
        reference=reference,
        times_real_time=times_real_time,
        jumps=_jumps(trace),
        duration_s=float(trace.time_s[-1]),
        rms_error_N=float(np.sqrt(np.mean((trace.force_N[on] - trace.reference_N[on]) ** 2))),
        peak_force_N=float(np.max(trace.force_N)),
        largest_voltage_V=float(np.max(np.abs(trace.voltage_V[on]))),
        margins=(),
        reach=_reach(loop),
    )


def _jumps(trace: Trace) -> tuple[Jump, ...]:
    """What a jump of the reference leads to; none where it has no jump."""
    try:
        return comparison.jumps(trace.time_s, trace.reference_N, trace.sensed_N, trace.mode)
    except DataError:
        return ()


def _loops(model: Model, wiring: Wiring) -> list[tuple[float, float, ForceLoop]]:
    """Force, tangent and loop at each force that is shown."""
    loop, rows = tracking.loop_for(model, wiring), tracking.rows_of(model)
    shown = nearest(rows, [force for force in SHOWN_N if force <= model.valid.force_N])
    return [(row.force_N, row.tangent_N_mm, loop.at(row, model.damping_N_s_mm)) for row in shown]


def _margins(force_N: float, tangent_N_mm: float, loop: ForceLoop, stiffness: float) -> LoopMargins:
    """Margins at one force, on tissue ``stiffness`` times as stiff as the model, and the worst of the span."""
    found, (worst_deg, worst_gain) = loop.margins(stiffness), loop.worst()
    return LoopMargins(
        force_N=force_N,
        tangent_N_mm=stiffness * tangent_N_mm,
        crossover_Hz=float(found.crossover_rad_s[0]) / (2 * math.pi),
        phase_deg=float(found.phase_deg[0]),
        gain=float(found.gain[0]),
        worst_phase_deg=worst_deg,
        worst_gain=worst_gain,
        stiffest_N_mm=tangent_N_mm * float(loop.tolerated()[0]),
    )


def _reach(loop: ForceLoop) -> LoopReach:
    return LoopReach(
        crossover_Hz=loop.law.crossover_rad_s / (2 * math.pi),
        lead_ms=1000 * loop.law.lead_s,
        drift_Hz=loop.law.drift_rad_s / (2 * math.pi),
        delay_ms=1000 * loop.axis.delay_s,
        left_of_motion=loop.left_of_motion(),
        noise_share=loop.noise_share(),
        largest_sensitivity=loop.largest_sensitivity(),
    )


def _draw(trace: Trace, surface_mm: float, out: Path, title: str) -> None:
    from rig.report.control_figures import Signals, run_figure  # noqa: PLC0415 - drawing takes a second to load
    from rig.report.drawing import save_figure  # noqa: PLC0415

    on = trace.mode == Mode.CONTACT
    time_s = trace.time_s[on]
    figure = run_figure(
        Signals(
            time_s - time_s[0], trace.reference_N[on], trace.force_N[on],
            trace.position_mm[on] - surface_mm, trace.current_A[on], trace.voltage_V[on],
        ),
        title,
    )  # fmt: skip
    save_figure(figure, out, "simulation")


def _draw_loops(loops: Sequence[tuple[float, float, ForceLoop]], stiffness: float, out: Path) -> None:
    from rig.report.drawing import svg  # noqa: PLC0415 - drawing takes a second to load
    from rig.report.loop_figures import bode_figure, nyquist_figure  # noqa: PLC0415

    omega = grid(loops[0][2].rates)
    curves = {f"{force_N:.1f} N": loop.response(stiffness, omega)[0] for force_N, _, loop in loops}
    write_text(out / "bode.svg", svg(bode_figure(omega / (2 * math.pi), curves)))
    write_text(out / "nyquist.svg", svg(nyquist_figure(omega / (2 * math.pi), curves)))
