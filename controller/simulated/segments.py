"""Stretches of a simulated run as machine code: many cycles in which only the plant and one law move.

A stretch ends before the first cycle in which anything else could happen: contact found, the end of a move, or an input
beyond a bound of the safety table. That cycle is left to the state machine, so that a run with stretches is cycle by
cycle the run without them. The functions compiled are those of the bench.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from controller.law import force_position, inverse_model
from controller.law.force_position import ForceReading
from controller.loop import setpoint
from controller.loop.setpoint import Setpoint
from rig.machine_code import compiled
from rig.simulation import axis_plant
from rig.simulation.axis_plant import AxisState, ForceSensing, ModelledLimb, Motor, PositionLoop

Column = NDArray[np.float64]
LawMemory = TypeVar("LawMemory")
ROWS = 6
# The functions of the force law, each after those that it calls.
LAW = force_position.react, force_position.limit, force_position.start_anew, force_position.increment


class InputBounds(NamedTuple):
    """What an input may be before the safety table has a word; force from the reference zero."""

    force_N: float = math.inf
    depth_mm: float = math.inf
    following_mm: float = math.inf
    low_mm: float = -math.inf
    high_mm: float = math.inf


class Timing(NamedTuple):
    """Number of the stretch's first cycle, time between cycles, and the plant's steps in it."""

    cycle: int
    dt_s: float
    steps: int


class Zeros(NamedTuple):
    """What the converter shows unloaded by the present zero and by the first one, and where the surface was found."""

    now_N: float
    first_N: float
    surface_mm: float


class Move(NamedTuple):
    """A move in the air; it is over where force passes ``until_N``."""

    target_mm: float
    speed_mm_s: float
    acceleration_mm_s2: float
    until_N: float


class BenchState(NamedTuple):
    """All that has memory between two cycles: plant, readings under way (oldest first), the one in use, set-point."""

    state: AxisState
    sensed_N: Column
    held_N: float
    setpoint: Setpoint


class Plant(NamedTuple):
    """The plant's four parts."""

    motor: Motor
    loop: PositionLoop
    limb: ModelledLimb
    sensing: ForceSensing


class Stretch(NamedTuple):
    """Ticks done; ``rows`` of shape (ROWS, cycles): tissue force, force sensed, command, position, voltage, current."""

    rows: Column
    bench: BenchState


def beyond(bounds: InputBounds, zeros: Zeros, raw_N: float, bench_position_mm: float, setpoint_mm: float) -> bool:
    """Whether the safety table would have a word."""
    return (
        abs(raw_N - zeros.first_N) > bounds.force_N
        or bench_position_mm - zeros.surface_mm > bounds.depth_mm
        or abs(setpoint_mm - bench_position_mm) > bounds.following_mm
        or bench_position_mm < bounds.low_mm
        or bench_position_mm > bounds.high_mm
    )


def _track(
    bench: BenchState, memory: Any, table: Any, settings: Any, reference_N: Column, noise: Column, plant: Plant,
    clock: Timing, zeros: Zeros, bounds: InputBounds,
) -> tuple[Column, AxisState, Column, float, float, float, Any]:  # fmt: skip
    motor, loop, limb, sensing = plant
    state, past, held_N, setpoint = bench
    command_mm, delta_mm, cycles, late = setpoint.position_mm, 0.0, len(reference_N), len(past)
    rows, sensed = np.empty((ROWS, cycles)), np.empty(cycles + late)
    sensed[:late] = past
    done = 0
    for i in range(cycles):
        raw_N = held_N if (clock.cycle + i) % sensing.every_cycles else reading(sensed[i], noise[i], sensing)
        if beyond(bounds, zeros, raw_N, state.position_mm, command_mm):
            break
        force_N = raw_N - zeros.now_N
        measured = ForceReading(force_N, (clock.cycle + i) // sensing.every_cycles)
        step_mm, after = increment(memory, table, settings, reference_N[i], measured, clock.dt_s)
        if command_mm + step_mm < bounds.low_mm or command_mm + step_mm > bounds.high_mm:
            break
        held_N, memory, delta_mm = raw_N, after, step_mm
        command_mm += delta_mm
        rows[0, i], rows[1, i], rows[2, i] = state.force_N, force_N, command_mm
        rows[3, i], rows[4, i], rows[5, i] = state.position_mm, state.voltage_V, state.current_A
        state = hold(state, motor, loop, limb, sensing, command_mm, clock.steps)
        sensed[i + late] = state.sensed_N
        done = i + 1
    return rows[:, :done], state, sensed[done : done + late], held_N, command_mm, delta_mm / clock.dt_s, memory


def _travel(
    bench: BenchState, move: Move, noise: Column, plant: Plant, clock: Timing, zeros: Zeros, bounds: InputBounds
) -> tuple[Column, AxisState, Column, float, float, float]:
    motor, loop, limb, sensing = plant
    state, past, held_N, setpoint = bench
    cycles, late = len(noise), len(past)
    rows, sensed = np.empty((ROWS, cycles)), np.empty(cycles + late)
    sensed[:late] = past
    done = 0
    for i in range(cycles):
        raw_N = held_N if (clock.cycle + i) % sensing.every_cycles else reading(sensed[i], noise[i], sensing)
        force_N = raw_N - zeros.now_N
        if force_N > move.until_N or beyond(bounds, zeros, raw_N, state.position_mm, setpoint.position_mm):
            break
        after = toward(setpoint, move.target_mm, move.speed_mm_s, move.acceleration_mm_s2, clock.dt_s)
        if after.position_mm == move.target_mm:
            break
        held_N, setpoint = raw_N, after
        rows[0, i], rows[1, i], rows[2, i] = state.force_N, force_N, setpoint.position_mm
        rows[3, i], rows[4, i], rows[5, i] = state.position_mm, state.voltage_V, state.current_A
        state = hold(state, motor, loop, limb, sensing, setpoint.position_mm, clock.steps)
        sensed[i + late] = state.sensed_N
        done = i + 1
    kept = sensed[done : done + late]
    return rows[:, :done], state, kept, held_N, setpoint.position_mm, setpoint.velocity_mm_s


@cache
def hold_compiled() -> Callable[..., AxisState]:
    """`axis_plant.hold` as machine code."""
    parts: dict[str, Callable[..., Any]] = {}
    for function in (axis_plant.surface, axis_plant.tissue_force, axis_plant.wanted_current, axis_plant.dry):
        parts[function.__name__] = compiled(function)
    parts["step"] = compiled(axis_plant.step, parts)
    return compiled(axis_plant.hold, parts)


@cache
def _parts() -> dict[str, Callable[..., Any]]:
    return {
        "toward": compiled(setpoint.toward, {"clamp": compiled(setpoint.clamp)}),
        "beyond": compiled(beyond),
        "reading": compiled(axis_plant.reading),
        "hold": hold_compiled(),
    }


@cache
def _tracker(law: tuple[Callable[..., Any], ...]) -> Callable[..., Any]:
    parts: dict[str, Callable[..., Any]] = {**_parts(), "interpolate": compiled(inverse_model.interpolate)}
    common: tuple[Callable[..., Any], ...] = inverse_model.resting, inverse_model.foresee, force_position.expect
    for function in (*common, *law):
        parts[function.__name__] = compiled(function, parts)
    return compiled(_track, parts)


@cache
def _traveller() -> Callable[..., tuple[Column, AxisState, Column, float, float, float]]:
    return compiled(_travel, _parts())


def track(
    bench: BenchState, memory: LawMemory, table: Any, settings: Any, reference_N: Column, noise: Column,
    plant: Plant, clock: Timing, zeros: Zeros, bounds: InputBounds, law: tuple[Callable[..., Any], ...] = LAW,
) -> tuple[Stretch, LawMemory]:  # fmt: skip
    """A law along ``reference_N`` of shape (cycles,), or less of it; ``law`` ends with its ``increment``."""
    rows, state, sensed, held_N, position_mm, velocity_mm_s, after = _tracker(law)(
        bench, memory, table, settings, reference_N, noise, plant, clock, zeros, bounds
    )
    return Stretch(rows, BenchState(state, sensed, held_N, Setpoint(position_mm, velocity_mm_s))), after


def travel(
    bench: BenchState, move: Move, noise: Column, plant: Plant, clock: Timing, zeros: Zeros, bounds: InputBounds
) -> Stretch:
    """A move in the air for as many cycles as ``noise`` has, or less."""
    rows, state, sensed, held_N, position_mm, velocity_mm_s = _traveller()(
        bench, move, noise, plant, clock, zeros, bounds
    )
    return Stretch(rows, BenchState(state, sensed, held_N, Setpoint(position_mm, velocity_mm_s)))


# Names that the stretches are bound to: the same functions, compiled where they are compiled.
increment, toward, hold, reading = force_position.increment, setpoint.toward, axis_plant.hold, axis_plant.reading
