"""One law on one limb that moves, relaxes and rubs, as machine code: the axis of the simulation, cycle by cycle."""

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.control import tried_law
from controller.law import force_position, inverse_model
from controller.law.force_position import ForceReading
from controller.simulated.alternatives import alternative_law
from rig.machine_code import compiled
from rig.simulation import axis_plant
from rig.simulation.axis_plant import (
    STEP_S,
    AxisState,
    ForceSensing,
    ModelledLimb,
    Motor,
    PositionLoop,
    at_rest,
    reading,
    step,
    tissue_force,
)

Column = NDArray[np.float64]
FAR_MM = 1e9  # the plant's own limb is out of the way: its force is worked out here, where the surface moves


class Contact(NamedTuple):
    """What the tissue does besides its curve: force that dies out, and dry friction in front of the sensor."""

    ratio: float = 0.0
    tau_s: float = 1.0
    friction_N: float = 0.0
    friction_mm: float = 0.1


class Bench(NamedTuple):
    """Axis, sensor and limb; ``surface_mm`` of shape (cycles + 1,), from where the axis stands at first."""

    motor: Motor
    loop: PositionLoop
    sensing: ForceSensing
    limb: ModelledLimb
    contact: Contact
    surface_mm: Column


class Law(NamedTuple):
    """A law as it is run: which, its table and settings, and how early it is asked."""

    kind: str
    table: Any
    settings: Any
    preview_s: float = 0.0


class Run(NamedTuple):
    """Force of the tissue, force sensed, and set-point, each of shape (cycles,)."""

    tissue_N: Column
    sensed_N: Column
    command_mm: Column


def moved(
    state: AxisState, contact_state: tuple[float, float], motor: Motor, loop: PositionLoop, sensing: ForceSensing,
    limb: ModelledLimb, contact: Contact, target_mm: float, steps: int, from_mm: float, to_mm: float,
) -> tuple[AxisState, tuple[float, float]]:  # fmt: skip
    """One cycle of plant under a surface that goes from ``from_mm`` to ``to_mm`` in it."""
    surface_mm_s = (to_mm - from_mm) / (steps * STEP_S)
    transient_N, bristle = contact_state
    for at in range(steps):
        after = step(state, motor, loop, limb, sensing, target_mm)
        surface_mm = from_mm + surface_mm_s * (at + 1) * STEP_S
        speed_mm_s = after.speed_rad_s * motor.lead_mm / (2 * math.pi)
        before_mm = state.position_mm - surface_mm + surface_mm_s * STEP_S
        rest_N = tissue_force(limb, before_mm, 0.0)
        depth_mm, into_mm_s = after.position_mm - surface_mm, speed_mm_s - surface_mm_s
        force_N = tissue_force(limb, depth_mm, into_mm_s)
        risen_N = tissue_force(limb, depth_mm, 0.0) - rest_N
        transient_N += contact.ratio * risen_N - transient_N * STEP_S / contact.tau_s
        force_N = max(force_N + transient_N, 0.0) if depth_mm > 0 else 0.0
        bristle += (speed_mm_s - abs(speed_mm_s) * bristle) * STEP_S / contact.friction_mm
        at_sensor_N = force_N + contact.friction_N * bristle
        sensed_N = state.sensed_N + STEP_S / (STEP_S + sensing.filter_s) * (at_sensor_N - state.sensed_N)
        state = AxisState(
            after.time_s, after.first_mm, after.reference_mm, after.reference_mm_s, after.integral_mm_s,
            after.voltage_V, after.current_A, after.speed_rad_s, after.position_mm, force_N, sensed_N,
        )  # fmt: skip
    return state, (transient_N, bristle)


def follow(
    state: AxisState, memory: Any, table: Any, settings: Any, reference_N: Column, noise: Column, bench: Bench,
    dt_s: float,
) -> Column:  # fmt: skip
    """Rows of ``Run`` along ``reference_N``, shape (3, cycles)."""
    motor, loop, sensing, limb, contact, surface_mm = bench
    cycles, late, held_N, command_mm = len(reference_N), sensing.delay_cycles, 0.0, state.position_mm
    rows, sensed = np.empty((3, cycles)), np.zeros(cycles + late + 1)
    steps, contact_state = round(dt_s / STEP_S), (0.0, 0.0)
    for i in range(cycles):
        if i % sensing.every_cycles == 0:
            held_N = reading(sensed[i], noise[i], sensing)
        measured = ForceReading(held_N, i // sensing.every_cycles)
        step_mm, memory = increment(memory, table, settings, reference_N[i], measured, dt_s)
        command_mm += step_mm
        rows[0, i], rows[1, i], rows[2, i] = state.force_N, held_N, command_mm
        state, contact_state = moved(
            state, contact_state, motor, loop, sensing, limb, contact, command_mm, steps, surface_mm[i],
            surface_mm[i + 1],
        )  # fmt: skip
        sensed[i + late + 1] = state.sensed_N
    return rows


@cache
def moved_compiled() -> Callable[..., Any]:
    """``moved`` as machine code."""
    parts: dict[str, Callable[..., Any]] = {}
    for function in (axis_plant.surface, axis_plant.tissue_force, axis_plant.wanted_current, axis_plant.dry):
        parts[function.__name__] = compiled(function)
    parts["step"] = compiled(axis_plant.step, parts)
    return compiled(moved, {name: parts[name] for name in ("step", "tissue_force")})


@cache
def _follower(kind: str) -> Callable[..., Column]:
    interpolate = {"interpolate": compiled(inverse_model.interpolate)}
    law: dict[str, Callable[..., Any]] = {**interpolate, "expect": compiled(force_position.expect)}
    law["foresee"] = compiled(inverse_model.foresee, interpolate)
    law["resting"] = compiled(inverse_model.resting, interpolate)
    law["correct"] = compiled(alternative_law.correct, interpolate)
    law["start_anew"] = compiled(force_position.start_anew, law)
    law |= {"react": compiled(force_position.react), "limit": compiled(force_position.limit)}
    law["law_increment"] = compiled(force_position.increment, law)
    law["rested"] = compiled(tried_law.rested)
    increments: dict[str, Callable[..., Any]] = {"alternative": alternative_law.increment, "tried": tried_law.increment}
    run_by = law["law_increment"] if kind == "shaped" else compiled(increments[kind], law)
    return compiled(follow, {"increment": run_by, "reading": compiled(reading), "moved": moved_compiled()})


def run(law: Law, reference_N: Column, bench: Bench, seed: int, dt_s: float = 0.001) -> Run:
    """The law from where the axis stands, 0 mm, along ``reference_N`` of shape (cycles,)."""
    memory = BEGIN[law.kind](law.table, law.settings.inverse, 0.0)
    noise = np.random.default_rng(seed).standard_normal(len(reference_N))
    state = at_rest(0.0)
    return Run(*_follower(law.kind)(state, memory, law.table, law.settings, reference_N, noise, bench, dt_s))


BEGIN: Mapping[str, Callable[..., Any]] = {
    "alternative": alternative_law.begin, "shaped": force_position.begin, "tried": tried_law.begin,
}  # fmt: skip
# The name that `follow` is bound to where it is compiled.
increment = force_position.increment
