"""The Z axis as physics: DC motor, screw, the drive's position loop around them, tissue under the tip, sensor.

One step of STEP_S:

    set-point -> two lags -> position loop -> current wanted -> voltage -> current -> torque -> screw -> tip
    L di/dt = U - R i - Ke w        J dw/dt = Kt i - friction - lead / (2 pi) F
    F = F(x - surface) + B (v - dsurface/dt)

The drive's loop is that of a positioning controller: velocity wanted = feed-forward + gain x error + integral, torque
from velocity error, current by voltage with compensated back-EMF, voltage within the supply. Functions take and return
numbers and tuples only, so that they can be compiled.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

STEP_S = 0.000_125  # a third of the motor's electrical time constant, and eight to a cycle at 1 kHz
MM_PER_M = 1000.0

Values: TypeAlias = Sequence[float] | NDArray[np.float64]


class Motor(NamedTuple):
    """A brushed motor of the 150 W class; ``inertia_kg_m2`` includes screw and carriage as seen from the shaft."""

    resistance_Ohm: float = 0.6
    inductance_H: float = 0.0002
    torque_N_m_A: float = 0.0369
    back_emf_V_s_rad: float = 0.0369
    inertia_kg_m2: float = 5.066e-6
    viscous_N_m_s: float = 3.2e-5
    coulomb_N_m: float = 0.0024
    supply_V: float = 48.0
    current_limit_A: float = 5.0
    lead_mm: float = 5.0


class PositionLoop(NamedTuple):
    """The drive's own loop; ``smoothing_s`` is the time constant of each of its two set-point filters."""

    position_gain_per_s: float = 120.0
    velocity_gain_per_s: float = 480.0
    integral_gain_per_s2: float = 1500.0
    smoothing_s: float = 0.003
    current_s: float = 0.0005


class ModelledLimb(NamedTuple):
    """Force-depth curve as columns of shape (n,), damping, and a surface that breathes."""

    depth_mm: Values
    force_N: Values
    damping_N_s_mm: float
    surface_mm: float = 20.0
    breathing_mm: float = 0.0
    breathing_Hz: float = 0.25


class ForceSensing(NamedTuple):
    """The force channel: its filter, whole cycles between capture and use, and cycles for which a sample stands."""

    filter_s: float = 0.0005
    noise_N: float = 0.005
    quantum_N: float = 0.001
    delay_cycles: int = 1
    every_cycles: int = 1


class AxisState(NamedTuple):
    """All that has memory; ``force_N`` is the tissue's, ``sensed_N`` after the sensor's filter."""

    time_s: float
    first_mm: float
    reference_mm: float
    reference_mm_s: float
    integral_mm_s: float
    voltage_V: float
    current_A: float
    speed_rad_s: float
    position_mm: float
    force_N: float
    sensed_N: float


def at_rest(position_mm: float) -> AxisState:
    """The axis standing at ``position_mm``, in the air."""
    return AxisState(0.0, position_mm, position_mm, 0.0, 0.0, 0.0, 0.0, 0.0, position_mm, 0.0, 0.0)


def surface(limb: ModelledLimb, time_s: float) -> tuple[float, float]:
    """Where the limb's surface is [mm], and its speed [mm/s]."""
    turn = 2 * math.pi * limb.breathing_Hz
    return (
        limb.surface_mm + limb.breathing_mm * math.sin(turn * time_s),
        limb.breathing_mm * turn * math.cos(turn * time_s),
    )


def tissue_force(limb: ModelledLimb, depth_mm: float, speed_mm_s: float) -> float:
    """Force on the tip [N], linear between the curve's points and beyond its last two; never a pull."""
    if depth_mm <= 0:
        return 0.0
    last = len(limb.depth_mm) - 1
    at = min(int(depth_mm / limb.depth_mm[last] * last), last - 1)
    share = (depth_mm - limb.depth_mm[at]) / (limb.depth_mm[at + 1] - limb.depth_mm[at])
    elastic_N = limb.force_N[at] + share * (limb.force_N[at + 1] - limb.force_N[at])
    return max(float(elastic_N) + limb.damping_N_s_mm * speed_mm_s, 0.0)


def wanted_current(
    state: AxisState, motor: Motor, loop: PositionLoop, acceleration_mm_s2: float
) -> tuple[float, float]:
    """Current the position loop asks for [A], within its limit, and the integral after this step."""
    per_rad = motor.lead_mm / (2 * math.pi)
    error_mm = state.reference_mm - state.position_mm
    wanted_mm_s = state.reference_mm_s + loop.position_gain_per_s * error_mm + state.integral_mm_s
    lacking = loop.velocity_gain_per_s * (wanted_mm_s - state.speed_rad_s * per_rad) + acceleration_mm_s2
    current_A = motor.inertia_kg_m2 * lacking / per_rad / motor.torque_N_m_A
    limit = motor.current_limit_A
    if -limit < current_A < limit:
        return current_A, state.integral_mm_s + loop.integral_gain_per_s2 * error_mm * STEP_S
    return min(max(current_A, -limit), limit), state.integral_mm_s


def dry(speed: float, grip: float) -> float:
    """``speed`` after Coulomb friction that can take away ``grip`` of it in this step."""
    if -grip <= speed <= grip:
        return 0.0
    return speed - grip if speed > 0 else speed + grip


def step(
    state: AxisState, motor: Motor, loop: PositionLoop, limb: ModelledLimb, sensing: ForceSensing, target_mm: float
) -> AxisState:
    """The axis STEP_S later, the set-point having been ``target_mm`` during it."""
    share = STEP_S / (STEP_S + loop.smoothing_s)
    first_mm = state.first_mm + share * (target_mm - state.first_mm)
    reference_mm_s = share * (first_mm - state.reference_mm) / STEP_S
    acceleration = (reference_mm_s - state.reference_mm_s) / STEP_S
    wanted_A, integral = wanted_current(state, motor, loop, acceleration)
    emf_V = motor.back_emf_V_s_rad * state.speed_rad_s
    drive_V = (
        motor.resistance_Ohm * wanted_A + emf_V + motor.inductance_H / loop.current_s * (wanted_A - state.current_A)
    )
    voltage_V = min(max(drive_V, -motor.supply_V), motor.supply_V)
    settled_A = (voltage_V - emf_V) / motor.resistance_Ohm
    decay = math.exp(-STEP_S * motor.resistance_Ohm / motor.inductance_H)
    current_A = settled_A + (state.current_A - settled_A) * decay
    per_rad = motor.lead_mm / (2 * math.pi)
    torque = (
        motor.torque_N_m_A * current_A - motor.viscous_N_m_s * state.speed_rad_s - state.force_N * per_rad / MM_PER_M
    )
    free = state.speed_rad_s + STEP_S * torque / motor.inertia_kg_m2
    speed = dry(free, STEP_S * motor.coulomb_N_m / motor.inertia_kg_m2)
    position_mm = state.position_mm + speed * per_rad * STEP_S
    time_s = state.time_s + STEP_S
    surface_mm, surface_mm_s = surface(limb, time_s)
    force_N = tissue_force(limb, position_mm - surface_mm, speed * per_rad - surface_mm_s)
    sensed_N = state.sensed_N + STEP_S / (STEP_S + sensing.filter_s) * (force_N - state.sensed_N)
    return AxisState(
        time_s, first_mm, state.reference_mm + reference_mm_s * STEP_S, reference_mm_s, integral, voltage_V, current_A,
        speed, position_mm, force_N, sensed_N,
    )  # fmt: skip


def hold(
    state: AxisState,
    motor: Motor,
    loop: PositionLoop,
    limb: ModelledLimb,
    sensing: ForceSensing,
    target_mm: float,
    steps: int,
) -> AxisState:
    """The axis ``steps`` steps later: the set-point is held, as between two cycles of the loop."""
    for _ in range(steps):
        state = step(state, motor, loop, limb, sensing, target_mm)
    return state


def reading(sensed_N: float, noise: float, sensing: ForceSensing) -> float:
    """What the converter gives, for a standard normal ``noise``."""
    value_N = sensed_N + noise * sensing.noise_N
    return round(value_N / sensing.quantum_N) * sensing.quantum_N if sensing.quantum_N > 0 else value_N
