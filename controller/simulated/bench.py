"""The bench on a virtual clock: the machine, its steps and the force law as they run on the bench, against the plant.

``run`` plays a whole program through the machine; stretches of it in which nothing is to be decided are played by the
same functions compiled together with the plant (`segments`). ``follow`` plays the force law alone, for sweeps.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.law import force_position, force_profile
from controller.law.force_profile import Line
from controller.law.inverse_model import Columns, columns
from controller.loop.modes import Mode
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.state_machine import MotionStateMachine
from controller.loop.steps import Approach, ApproachRun, Program, Retract, TrackForce
from controller.safety.inputs import SafetyInputs
from controller.safety.load import TipLoad
from controller.safety.table import Incident
from controller.simulated import segments
from controller.simulated.segments import BenchState, InputBounds, Move, Plant, Stretch, Timing, Zeros, hold_compiled
from rig.config.wiring import Wiring
from rig.errors import CheckFailed
from rig.simulation import axis_plant
from rig.simulation.axis_plant import ForceSensing, ModelledLimb, Motor, PositionLoop, at_rest
from rig.tissue.model import Model

Column = NDArray[np.float64]
CURVE_POINTS = 400
BEYOND = 2.0
LONGEST_S = 600.0  # ten forces of 1.5 s each take 15 s: a program that takes forty times as long has no end
LONGEST_STRETCH = 10_000  # most steps end within 10 s of 1 kHz, and noise is drawn for a whole stretch
DRAWN = 20_000  # two stretches at a time: every append copies all that was drawn before
MOTOR, POSITION_LOOP, SENSING = Motor(), PositionLoop(), ForceSensing()


class Trace(NamedTuple):
    """What a simulated run gives, each of shape (cycles,); forces are those of tissue and sensor."""

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

    limb: ModelledLimb
    motor: Motor = MOTOR
    loop: PositionLoop = POSITION_LOOP
    sensing: ForceSensing = SENSING
    seed: int = 0


def limb_of(
    model: Model, stiffness: float = 1.0, breathing_mm: float = 0.0, breathing_Hz: float = 0.25
) -> ModelledLimb:
    """The tissue a model describes, up to twice its depth, ``stiffness`` times as stiff."""
    depths = np.linspace(0.0, BEYOND * model.valid.depth_mm, CURVE_POINTS)
    forces = stiffness * np.asarray(model.law.force(depths))
    return ModelledLimb(depths, forces, model.damping_N_s_mm, breathing_mm=breathing_mm, breathing_Hz=breathing_Hz)


def run(program: Program, wiring: Wiring, bench: SimulatedBench, stretched: bool = True) -> Trace:
    """Plays ``program`` to its end, safety table included; raises CheckFailed where a limit stops it.

    Without ``stretched`` every cycle goes through the state machine, with the same result.
    """
    return _Playback(program, wiring, bench).play(stretched)


class _Playback:
    """One run: the machine cycle by cycle, and stretches of cycles between in machine code."""

    def __init__(self, program: Program, wiring: Wiring, bench: SimulatedBench) -> None:
        self._wiring, self._period_s = wiring, 1.0 / wiring.loop.rate_Hz
        self._plant = Plant(bench.motor, bench.loop, bench.limb, bench.sensing)
        start_mm = wiring.limits.position_min_mm + 10.0
        late = bench.sensing.delay_cycles + 1
        self._now = BenchState(at_rest(start_mm), np.zeros(late), 0.0, Setpoint(start_mm, 0.0))
        self._cycle, self._random, self._noise = 0, np.random.default_rng(bench.seed), np.empty(0)
        self._parts: list[Column] = []
        self._ended: list[Incident | None] = []
        acceleration = wiring.axis.acceleration_mm_s2
        self._state = LoopState(dt_s=self._period_s, acceleration_mm_s2=acceleration, position_mm=start_mm)
        self._state.position_min_mm = wiring.limits.position_min_mm
        self._machine = MotionStateMachine(wiring, self._state, lambda _, incident: self._ended.append(incident))
        self._machine.start(program)
        self._law: tuple[TrackForce, Columns, Line] | None = None

    def play(self, stretched: bool) -> Trace:
        steps, inputs = round(self._period_s / axis_plant.STEP_S), SafetyInputs()
        while self._cycle * self._period_s < LONGEST_S and self._turn(inputs, steps):
            if stretched:
                self._stretch(steps)
        if not self._ended or self._ended[0]:
            cause = self._ended[0].text if self._ended and self._ended[0] else "it has no end"
            raise CheckFailed(f"the simulated run was stopped: {cause}")
        table = np.concatenate(self._parts, axis=1)
        return Trace(table[0], table[1].astype(np.int64), *table[2:])

    def _turn(self, inputs: SafetyInputs, steps: int) -> bool:
        """One cycle through the state machine; False once nothing moves any more."""
        state, machine, (plant, sensed, held_N, _) = self._state, self._machine, self._now
        sensing = self._plant.sensing
        if self._cycle % sensing.every_cycles == 0:
            held_N = axis_plant.reading(sensed[0], self._drawn(1)[0], sensing)
        state.now_ns, state.raw_N = round(self._cycle * self._period_s * 1e9), held_N
        state.force_samples = self._cycle // sensing.every_cycles
        state.wrench = (0.0, 0.0, held_N, 0.0, 0.0, 0.0)
        load_N = abs(held_N - self._zeros().first_N)
        state.load = TipLoad(load_N, 0.0, 0.0, 0.0, load_N, 0.0)
        state.force_N, state.position_mm = state.raw_N - state.zero_N, plant.position_mm
        state.following_mm = state.setpoint.position_mm - state.position_mm
        self._pair(self._cycle, state.raw_N, state.position_mm)
        machine.update(inputs)
        command_mm = state.setpoint.position_mm
        row = (state.now_ns * 1e-9, machine.mode, state.reference_N, plant.force_N, state.force_N, command_mm,
               plant.position_mm, plant.voltage_V, plant.current_A)  # fmt: skip
        self._parts.append(np.array(row)[:, None])
        if machine.busy:
            plant = hold_compiled()(plant, *self._plant, command_mm, steps)
            self._now = BenchState(plant, np.append(sensed[1:], plant.sensed_N), held_N, state.setpoint)
        self._cycle += 1
        return machine.busy

    def _pair(self, cycle: int, raw_N: float, position_mm: float) -> None:
        """One cycle's samples as devices would tell them: force is sensed as many cycles late as the sensor is."""
        sensing, paired = self._plant.sensing, self._state.paired
        if cycle % sensing.every_cycles == 0:
            paired.force(round((cycle - sensing.delay_cycles) * self._period_s * 1e9), raw_N)
        paired.axis(round(cycle * self._period_s * 1e9), position_mm)

    def _drawn(self, count: int) -> Column:
        """Standard normals of the next ``count`` cycles."""
        lacking = self._cycle + count - len(self._noise)
        if lacking > 0:
            self._noise = np.append(self._noise, self._random.standard_normal(max(lacking, DRAWN)))
        return self._noise[self._cycle : self._cycle + count]

    def _stretch(self, steps: int) -> None:
        """As many cycles as can be without the state machine; none where it has to decide."""
        state, step, run = self._state, self._machine.step, self._machine.run
        if state.now_ns == self._machine.step_start_ns:  # its first cycle may set more than the set-point
            return
        if isinstance(step, TrackForce) and state.memory is not None:
            self._follow(step, steps)
        elif isinstance(step, Approach) and isinstance(run, ApproachRun) and run.has_run_in and run.searches:
            self._travel(step.search_to_mm, step.speed_mm_s, run.threshold_N(state), steps)
        elif isinstance(step, Retract):
            self._travel(step.target_mm(state), step.speed_mm_s, math.inf, steps)

    def _follow(self, step: TrackForce, steps: int) -> None:
        state = self._state
        assert state.memory
        if self._law is None or self._law[0] is not step:
            self._law = step, _columns(step), force_profile.preview(step.given, step.preview_s)
        elapsed_s = self._times_ns(LONGEST_STRETCH, self._machine.step_start_ns) * 1e-9
        elapsed_s = elapsed_s[elapsed_s < step.given.duration_s]
        reference_N = force_profile.along(step.given, elapsed_s)
        asked_N = force_profile.along(self._law[2], elapsed_s)
        done, memory = segments.track(
            self._now, state.memory, self._law[1], step.settings, asked_N, self._drawn(len(asked_N)),
            self._plant, Timing(self._cycle, self._period_s, steps), self._zeros(), self._bounds(),
        )  # fmt: skip
        state.memory, cycles = memory, done.rows.shape[1]
        if cycles:
            state.reference_N, state.tangent_N_mm = float(reference_N[cycles - 1]), memory.tangent_N_mm
        self._take(done, reference_N[:cycles])

    def _travel(self, target_mm: float, speed_mm_s: float, until_N: float, steps: int) -> None:
        move = Move(target_mm, speed_mm_s, self._state.acceleration_mm_s2, until_N)
        clock = Timing(self._cycle, self._period_s, steps)
        noise = self._drawn(LONGEST_STRETCH)
        done = segments.travel(self._now, move, noise, self._plant, clock, self._zeros(), self._bounds())
        if self._state.paired.collecting:
            for index, (force_N, position_mm) in enumerate(done.rows[[1, 3]].T.tolist()):
                self._pair(self._cycle + index, force_N + self._state.zero_N, position_mm)
        self._take(done, np.full(done.rows.shape[1], self._state.reference_N))

    def _take(self, done: Stretch, reference_N: Column) -> None:
        cycles = done.rows.shape[1]
        times_s, mode = self._times_ns(cycles) * 1e-9, np.full(cycles, float(self._machine.mode))
        self._parts.append(np.vstack([times_s, mode, reference_N, done.rows]))
        self._state.setpoint, self._now = done.bench.setpoint, done.bench
        self._state.peak_force_N = max(self._state.peak_force_N, float(np.max(done.rows[1], initial=0.0)))
        self._cycle += cycles

    def _times_ns(self, count: int, since_ns: int = 0) -> Column:
        return np.round(np.arange(self._cycle, self._cycle + count) * self._period_s * 1e9) - since_ns

    def _zeros(self) -> Zeros:
        state = self._state
        first_N = state.reference_zero[2] if state.reference_zero else 0.0
        return Zeros(state.zero_N, first_N, state.surface_mm)

    def _bounds(self) -> InputBounds:
        limits, axis = self._wiring.limits, self._wiring.axis
        return InputBounds(
            self._wiring.force_limit_N, limits.depth_mm, axis.following_error_mm,
            limits.position_min_mm, limits.position_max_mm,
        )  # fmt: skip


def _columns(step: TrackForce) -> Columns:
    return Columns(*map(np.array, columns(step.gains)))


def follow(
    step: TrackForce, reference_N: Column, bench: SimulatedBench, dt_s: float = 0.001, clearance_mm: float = 0.0
) -> Trace:
    """The force law alone, from ``clearance_mm`` above the surface on, along ``reference_N`` of (cycles,); compiled."""
    table = _columns(step)
    memory = force_position.begin(table, step.settings.inverse, 0.0)
    return follow_law(segments.LAW, memory, table, step.settings, reference_N, bench, dt_s, clearance_mm)


def follow_law(
    law: tuple[Callable[..., Any], ...], memory: object, table: object, settings: object, reference_N: Column,
    bench: SimulatedBench, dt_s: float = 0.001, clearance_mm: float = 0.0,
) -> Trace:  # fmt: skip
    """The same of any law: its functions, memory, table and settings as `segments.track` takes them."""
    surface_mm = bench.limb.surface_mm
    noise = np.random.default_rng(bench.seed).standard_normal(len(reference_N))
    late, start_mm = bench.sensing.delay_cycles + 1, surface_mm - clearance_mm
    start = BenchState(at_rest(start_mm), np.zeros(late), 0.0, Setpoint(start_mm, 0.0))
    done, _ = segments.track(
        start, memory, table, settings, reference_N, noise, Plant(bench.motor, bench.loop, bench.limb, bench.sensing),
        Timing(0, dt_s, round(dt_s / axis_plant.STEP_S)), Zeros(0.0, 0.0, surface_mm), InputBounds(), law,
    )  # fmt: skip
    time_s, mode = np.arange(len(reference_N), dtype=np.float64) * dt_s, np.full(len(reference_N), int(Mode.CONTACT))
    return Trace(time_s, mode, reference_N, *done.rows)
