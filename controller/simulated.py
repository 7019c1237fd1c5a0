"""The bench on a virtual clock: the machine, its steps and the force law as they run on the bench, against the plant.

``run`` plays a whole program through the machine. ``follow`` plays the force law alone, compiled together with the
plant, for sweeps over subjects and gains; both call the same functions of `force_position`.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller import force_position
from controller.compiled import compiled
from controller.force_position import Columns, Settings
from controller.machine import Machine
from controller.modes import Mode
from controller.safety import Incident, Watch
from controller.steps import Program, TrackForce
from controller.world import World
from rig.config.wiring import Wiring
from rig.errors import CheckFailed
from rig.simulation import axis_plant
from rig.simulation.axis_plant import AxisState, Limb, Motor, PositionLoop, Sensing, at_rest
from rig.tissue.model import Model

Column = NDArray[np.float64]
CURVE_POINTS = 400
BEYOND = 2.0
LONGEST_S = 600.0
MOTOR, POSITION_LOOP, SENSING = Motor(), PositionLoop(), Sensing()


class Trace(NamedTuple):
    """What a simulated run gives, each of shape (ticks,); forces are those of tissue and sensor."""

    time_s: Column
    mode: NDArray[np.int64]
    reference_N: Column
    force_N: Column
    sensed_N: Column
    command_mm: Column
    position_mm: Column
    voltage_V: Column
    current_A: Column


@dataclass(frozen=True)
class SimulatedBench:
    """The plant a program is played against."""

    limb: Limb
    motor: Motor = MOTOR
    loop: PositionLoop = POSITION_LOOP
    sensing: Sensing = SENSING
    seed: int = 0


def limb_of(model: Model, stiffness: float = 1.0, breathing_mm: float = 0.0, breathing_Hz: float = 0.25) -> Limb:
    """The tissue a model describes, up to twice its depth, ``stiffness`` times as stiff."""
    depths = np.linspace(0.0, BEYOND * model.valid.depth_mm, CURVE_POINTS)
    forces = stiffness * np.asarray(model.law.force(depths))
    return Limb(depths, forces, model.damping_N_s_mm, breathing_mm=breathing_mm, breathing_Hz=breathing_Hz)


@cache
def _hold() -> Callable[..., AxisState]:
    parts: dict[str, object] = {}
    for function in (axis_plant.surface, axis_plant.tissue_force, axis_plant.wanted_current, axis_plant.dry):
        parts[function.__name__] = compiled(function)
    parts["step"] = compiled(axis_plant.step, parts)
    return compiled(axis_plant.hold, parts)


@cache
def _law() -> Callable[..., tuple[float, force_position.Memory]]:
    parts: dict[str, object] = {"interpolate": compiled(force_position.interpolate)}
    parts["foresee"] = compiled(force_position.foresee, parts)
    parts["adapt"] = compiled(force_position.adapt, parts)
    return compiled(force_position.increment, parts)


def run(program: Program, wiring: Wiring, bench: SimulatedBench) -> Trace:
    """Plays ``program`` to its end, safety table included; raises CheckFailed where a limit stops it."""
    period_s = 1.0 / wiring.loop.rate_Hz
    steps = round(period_s / axis_plant.STEP_S)
    state = at_rest(wiring.limits.position_min_mm + 10.0)
    world = World(dt_s=period_s, acceleration_mm_s2=wiring.axis.acceleration_mm_s2, position_mm=state.position_mm)
    ended: list[Incident | None] = []
    machine = Machine(wiring, world, lambda _, incident: ended.append(incident))
    machine.start(program)
    watch, rows = Watch(), []
    noise = np.random.default_rng(bench.seed).standard_normal(round(LONGEST_S / period_s)).tolist()
    sensed = deque([0.0] * (bench.sensing.delay_ticks + 1), maxlen=bench.sensing.delay_ticks + 1)
    hold, plant = _hold(), (bench.motor, bench.loop, bench.limb, bench.sensing)
    for tick, unit in enumerate(noise):
        world.now_ns = round(tick * period_s * 1e9)
        world.raw_N, world.force_samples = axis_plant.reading(sensed[0], unit, bench.sensing), tick
        world.force_N, world.position_mm = world.raw_N - world.zero_N, state.position_mm
        world.following_mm = world.setpoint.position_mm - world.position_mm
        machine.update(watch)
        command_mm = world.setpoint.position_mm
        rows.append(
            (world.now_ns * 1e-9, machine.mode, world.reference_N, state.force_N, world.force_N, command_mm,
             state.position_mm, state.voltage_V, state.current_A)
        )  # fmt: skip
        if not machine.busy:
            break
        state = hold(state, *plant, command_mm, steps)
        sensed.append(state.sensed_N)
    if not ended or ended[0]:
        raise CheckFailed(f"the simulated run was stopped: {ended[0].text if ended and ended[0] else 'it has no end'}")
    table = np.array(rows)
    return Trace(table[:, 0], table[:, 1].astype(np.int64), *(table[:, at] for at in range(2, table.shape[1])))


def follow(step: TrackForce, reference_N: Column, bench: SimulatedBench, dt_s: float = 0.001) -> Trace:
    """The force law alone, from contact on, along ``reference_N`` of shape (ticks,); compiled."""
    table = Columns(*map(np.array, force_position.columns(step.gains)))
    settings = step.settings
    noise = np.random.default_rng(bench.seed).standard_normal(len(reference_N))
    steps = round(dt_s / axis_plant.STEP_S)
    plant = (bench.motor, bench.loop, bench.limb, bench.sensing)
    rows = _follower()(table, settings, reference_N, noise, plant, step.speed_limit_mm_s * dt_s, dt_s, steps)
    time_s, mode = np.arange(len(reference_N), dtype=np.float64) * dt_s, np.full(len(reference_N), int(Mode.CONTACT))
    return Trace(time_s, mode, reference_N, *rows)


@cache
def _follower() -> Callable[..., Column]:
    parts: dict[str, object] = {
        "increment": _law(), "hold": _hold(), "reading": compiled(axis_plant.reading),
        "begin": compiled(force_position.begin, {"interpolate": compiled(force_position.interpolate)}),
        "at_rest": compiled(axis_plant.at_rest), "np": np,
    }  # fmt: skip
    return compiled(_follow, parts)


def _follow(
    table: Columns, settings: Settings, reference_N: Column, noise: Column,
    plant: tuple[Motor, PositionLoop, Limb, Sensing], largest_mm: float, dt_s: float, steps: int,
) -> Column:  # fmt: skip
    motor, loop, limb, sensing = plant
    state = at_rest(limb.surface_mm)
    command_mm = limb.surface_mm
    memory = begin(table, 0.0, 0.0)
    rows = np.empty((6, len(reference_N)))
    sensed = np.zeros(len(reference_N) + sensing.delay_ticks + 1)
    for tick in range(len(reference_N)):
        sampled = tick - tick % sensing.every_ticks
        force_N = reading(sensed[sampled], noise[sampled], sensing)
        depth_mm = state.position_mm - limb.surface_mm
        delta_mm, memory = increment(memory, table, settings, reference_N[tick], force_N, depth_mm, dt_s)
        command_mm += min(max(delta_mm, -largest_mm), largest_mm)
        rows[0, tick], rows[1, tick], rows[2, tick] = state.force_N, force_N, command_mm
        rows[3, tick], rows[4, tick], rows[5, tick] = state.position_mm, state.voltage_V, state.current_A
        state = hold(state, motor, loop, limb, sensing, command_mm, steps)
        sensed[tick + sensing.delay_ticks + 1] = state.sensed_N
    return rows


# Names that `_follow` is bound to: the same functions, compiled where it is compiled.
increment, begin = force_position.increment, force_position.begin
hold, reading = axis_plant.hold, axis_plant.reading
