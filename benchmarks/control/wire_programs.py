"""What is played on the bench and in the simulation alike, and by which number each is judged."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from benchmarks.control.cases import (
    DT_S,
    FORCES_N,
    SMOOTH_S,
    Asked,
    settling,
    stair_levels,
)
from benchmarks.control.motion import Column, Run
from controller.experiments import tracked
from controller.experiments.references import Reference
from controller.law.force_profile import Line
from controller.loop.steps import Hold, Program, Retract, TrackForce
from rig.config.wiring import Wiring
from rig.tissue.model import Model

Kind = Literal["limb", "contact", "low jumps", "jumps"]
SWING_HZ = 2.0
# Three turns of the limb are judged; the loop has settled for a second then.
HOLD_S, JUDGED_S, JUMP_S = 2.5, 1.5, 1.0
STAIRS = {"low jumps": (0.3, 1.5, 0.3), "jumps": (1.0, 10.0, 1.0)}
TOUCH_N, TOUCH_S, TOUCHES, GAP_MM = 0.3, 0.6, 5, 0.5
TOUCH_SMOOTH = 5  # samples of a peak: of a sample's noise, 0.017 of 0.3 N, less than a hundredth is left
# Steps out of contact between two touches last longer; a loop that misses so many slots has stopped.
APART_S = 0.1


def program(kind: Kind, model: Model, wiring: Wiring) -> Program:
    """Approach, the part's reference, and out again; checked as `rig track` checks it."""
    if kind == "contact":
        return _touches(tracked.plan([TOUCH_N], 2.0, model, wiring))
    return tracked.plan_reference(_reference(kind), model, wiring)


def _reference(kind: Kind) -> Reference:
    levels, each_s = (FORCES_N, HOLD_S) if kind == "limb" else (stair_levels(*STAIRS[kind]), JUMP_S)
    times = tuple(at * each_s for level in range(len(levels)) for at in (level, level + 1))
    return Reference(kind, times, tuple(force_N for force_N in levels for _ in range(2)))


def _touches(plan: Program) -> Program:
    """The limb met again and again out of the air by the force law alone."""
    zero, approach, *_, law, retract, hold = plan.steps
    assert isinstance(law, TrackForce)
    held = law.model_copy(update={"times_s": (0.0, TOUCH_S), "forces_N": (TOUCH_N, TOUCH_N)})
    touch = Retract(clearance_mm=GAP_MM, speed_mm_s=10.0), Hold(duration_s=0.2), held
    return plan.model_copy(update={"steps": (zero, approach, *(TOUCHES * touch), retract, hold)})


def simulated_line(kind: Kind, played: Program) -> tuple[Line, float]:
    """The reference of all track steps, and how far off the limb is at first; one touch stands for all."""
    tracks = [step for step in played.steps if isinstance(step, TrackForce)]
    if kind == "contact":
        return tracks[0].given, GAP_MM
    times: list[float] = []
    for step in tracks:
        begin_s = times[-1] if times else 0.0
        times += [begin_s + at for at in step.times_s]
    return Line(times, [force_N for step in tracks for force_N in step.forces_N]), 0.0


def judge(kind: Kind, stiffness: float, asked: Asked, force_N: Column) -> Mapping[str, float]:
    """Numbers by the names of the benchmark's cases, smaller is better."""
    if kind == "limb":
        smooth_N = _smooth(force_N, round(SMOOTH_S / DT_S))
        return {f"limb {SWING_HZ:g} Hz, {level_N:g} N": _rms(asked, smooth_N, level_N) for level_N in FORCES_N}
    if kind == "contact":
        return {"contact, 0 mm/s": _peak(_smooth(force_N, TOUCH_SMOOTH), asked)}
    return {f"{kind}, x{stiffness:g}": settling(asked, Run(force_N, force_N, force_N))}


def _rms(asked: Asked, force_N: Column, level_N: float) -> float:
    """Rms error [N] at the end of a level, before what is smoothed with the next one."""
    end = int(np.flatnonzero(np.isclose(asked.reference_N, level_N))[-1]) - round(SMOOTH_S / DT_S)
    error_N = force_N[end - round(JUDGED_S / DT_S) : end] - level_N
    return float(np.sqrt(np.mean(error_N**2)))


def _peak(force_N: Column, asked: Asked) -> float:
    """Mean over touches of the largest force over that asked for."""
    touches = np.array_split(force_N, max(1, round(len(force_N) * DT_S / TOUCH_S)))
    return float(np.mean([touch.max() for touch in touches])) / float(asked.reference_N[0])


def _smooth(force_N: Column, samples: int) -> Column:
    return np.convolve(force_N, np.full(samples, 1 / samples), mode="same")
