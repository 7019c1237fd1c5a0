"""The chain: measured motion -> kinematics -> environment -> tissue -> guide -> sensor -> time stamps.

Every cause vanishes at its null value, so to extend the simulation is to move one number off its null. Causes of the
carriage and of the sensor bring operators of their own; those that act through tissue and guide stand here. All are
pure and vectorised over all recordings of a session.
"""

from collections.abc import Callable, Iterable
from typing import Literal, NamedTuple, get_args

import numpy as np

from rig.simulation.drive import Array, MeasuredMotion
from rig.simulation.scans import dahl
from rig.tissue.history import Term
from rig.tissue.index_law import Fields, extended_force
from rig.tissue.laws_extended import Extended

NULLS: dict[str, float] = {
    "a_N_mm": 0.5,
    "b_per_mm": 0.0,
    "damping_N_s_mm": 0.0,
    "surface_mm": 0.0,
    "zero_N": 0.0,
    "tip_zero_mm": 0.0,
    **Extended.known,
    "rate_exponent": 1.0,
    "preconditioning_gain": 0.0,
    "preconditioning_cycles": 3.0,
    "adhesion_N": 0.0,
    "adhesion_length_mm": 1.0,
    "temperature_per_K": 0.0,
    "contact_offset_mm": 0.0,
    "surface_motion_sin_mm": 0.0,
    "surface_motion_cos_mm": 0.0,
    "surface_motion_Hz": 0.25,
    "friction_start": 0.0,
    "tip_inertia_kg": 0.0,
    "tracker_latency_s": 0.0,
}
REFERENCE_SPEED_MM_S = 10.0
COMPLIANCE_ITERATIONS = 4


Stage = Literal["carriage", "sensing", "reading", "stamping"]
STAGES: tuple[Stage, ...] = get_args(Stage)
Series = Array | float


class Operator(NamedTuple):
    """What a cause does at one stage: ``act(drive, signal, values)`` gives the signal as it leaves, shape (n,).

    Signals: at ``carriage``, carriage minus encoder [mm], 0.0 where there is no error; at ``sensing``, the force [N] on
    the sensor, before its zero; at ``reading``, with its zero; at ``stamping``, as it carries its time stamps.
    """

    stage: Stage
    act: Callable[[MeasuredMotion, Series, Fields], Series]


class Response(NamedTuple):
    """What the sensors would read: force on the grid, shape (n,), and the tip at the tracker's frames, shape (m,)."""

    force_N: Array
    tip_mm: Array


class Tip(NamedTuple):
    """The tip's motion, each shape (n,)."""

    position_mm: Array
    velocity_mm_s: Array
    acceleration_mm_s2: Array


def one(v: Fields, name: str) -> float:
    """A parameter that is the same for all recordings."""
    return float(v[name])


def respond(drive: MeasuredMotion, values: Fields, operators: Iterable[Operator] = ()) -> Response:
    """Sensor readings for the measured motion; parameters not in ``values`` are at their null, those of operators not.

    ``operators`` of one stage act in their order.
    """
    v = {**NULLS, **values}
    by_stage = {stage: [operator for operator in operators if operator.stage == stage] for stage in STAGES}

    def through(stage: Stage, signal: Series) -> Series:
        for operator in by_stage[stage]:
            signal = operator.act(drive, signal, v)
        return signal

    carriage = _moved(drive, through("carriage", 0.0))
    tip = compressed_frame(drive, carriage, v) if one(v, "frame_compliance_mm_N") else carriage
    force = through("sensing", on_sensor(drive, tip, v)) + v["zero_N"]
    seen = drive.at_tracker(tip.position_mm, one(v, "tracker_latency_s")) + v["tip_zero_mm"]
    return Response(np.asarray(through("stamping", through("reading", force))), seen)


def _moved(drive: MeasuredMotion, offset: Array | float) -> Tip:
    if isinstance(offset, float):
        return Tip(drive.position_mm, drive.velocity_mm_s, drive.acceleration_mm_s2)
    rate = drive.rate(offset)
    return Tip(drive.position_mm + offset, drive.velocity_mm_s + rate, drive.acceleration_mm_s2 + drive.rate(rate))


def compressed_frame(drive: MeasuredMotion, carriage: Tip, v: Fields) -> Tip:
    """The tip stays behind the carriage by compliance times force: Newton with the elastic tangent, per sample."""
    compliance, tip = one(v, "frame_compliance_mm_N"), carriage
    for _ in range(COMPLIANCE_ITERATIONS):
        lag = carriage.position_mm - tip.position_mm
        tangent = _tangent(depth_of(drive, tip, v), v)
        force = tissue(drive, tip, v) + friction(drive, tip, v)
        lag = lag + (compliance * force - lag) / (1 + compliance * tangent)
        rate = drive.rate(lag)
        tip = Tip(
            carriage.position_mm - lag, carriage.velocity_mm_s - rate, carriage.acceleration_mm_s2 - drive.rate(rate)
        )
    return tip


def depth_of(drive: MeasuredMotion, tip: Tip, v: Fields) -> Array:
    """Signed distance of the tip below the surface [mm]."""
    surface = v["surface_mm"] + v["contact_offset_mm"] + surface_motion(drive, v)
    return tip.position_mm - surface


def surface_motion(drive: MeasuredMotion, v: Fields) -> Array | float:
    """Breathing or pulse: displacement of the surface along the axis [mm] at session time."""
    if not (v["surface_motion_sin_mm"] or v["surface_motion_cos_mm"]):
        return 0.0
    phase = 2 * np.pi * v["surface_motion_Hz"] * drive.time_s
    return np.asarray(v["surface_motion_sin_mm"] * np.sin(phase) + v["surface_motion_cos_mm"] * np.cos(phase))


def contact(depth_mm: Array, travel_mm: Array) -> tuple[Array, Array]:
    """Mean depth inside and share of time in contact while the tip travels by ``travel_mm`` in one sample."""
    half = np.maximum(0.5 * np.abs(travel_mm), 1e-9)
    share = np.minimum(np.maximum(0.5 + 0.5 * depth_mm / half, 0.0), 1.0)
    crossing = (depth_mm > -half) & (depth_mm < half)
    return np.where(crossing, (depth_mm + half) ** 2 / (4 * half), np.maximum(depth_mm, 0.0)), share


def elastic(depth_mm: Array, v: Fields) -> Array:
    """The tissue's force at rest [N]; none outside."""
    return extended_force(np.maximum(depth_mm, 0.0), v)


def _tangent(depth_mm: Array, v: Fields) -> Array:
    step = 1e-3
    return (elastic(depth_mm + step, v) - elastic(depth_mm - step, v)) / (2 * step)


def viscous(velocity_mm_s: Array, v: Fields) -> Array:
    """Rate term: B v, or B v0 |v/v0|^n with v0 = 10 mm/s for an exponent off its null [N]."""
    if v["rate_exponent"] == 1:
        return np.asarray(v["damping_N_s_mm"] * velocity_mm_s)
    ratio = np.abs(velocity_mm_s) / REFERENCE_SPEED_MM_S
    law = np.sign(velocity_mm_s) * np.maximum(ratio, 1e-9) ** v["rate_exponent"]
    return np.asarray(v["damping_N_s_mm"] * REFERENCE_SPEED_MM_S * law)


def tissue(drive: MeasuredMotion, tip: Tip, v: Fields) -> Array:
    """Force of the tissue on the tip [N]."""
    moving = surface_motion(drive, v)
    depth = tip.position_mm - (v["surface_mm"] + v["contact_offset_mm"] + moving)
    velocity = tip.velocity_mm_s if isinstance(moving, float) else tip.velocity_mm_s - drive.rate(moving)
    inside, touching = contact(depth, velocity * drive.period_s)
    force = elastic(inside, v)
    if v["preconditioning_gain"]:
        force = force * (1 + v["preconditioning_gain"] * np.exp(-drive.cycle / v["preconditioning_cycles"]))
    if v["temperature_per_K"] and drive.temperature_C is not None:
        force = force * (1 + v["temperature_per_K"] * (drive.temperature_C - drive.temperature_C.mean()))
    if one(v, "relaxation_ratio"):
        force = drive.history.respond(force, [Term(one(v, "relaxation_ratio"), one(v, "tau_s"))])
    force = force + touching * viscous(velocity, v)
    # Nothing holds tip and tissue together but adhesion: the rest can only push.
    return np.maximum(force, 0.0) + adhesion(tip, depth, drive, v)


def adhesion(tip: Tip, depth_mm: Array, drive: MeasuredMotion, v: Fields) -> Array | float:
    """Pull on the way out, once the tip has touched: -Fad exp(-(d/l)^2) [N]."""
    if not one(v, "adhesion_N"):
        return 0.0
    touched = np.maximum.accumulate(np.where(depth_mm > 0, drive.recording + 1, 0)) == drive.recording + 1
    leaving = touched & (tip.velocity_mm_s < 0)
    return np.asarray(-one(v, "adhesion_N") * np.exp(-((depth_mm / one(v, "adhesion_length_mm")) ** 2)) * leaving)


def friction(drive: MeasuredMotion, tip: Tip, v: Fields) -> Array | float:
    """Guide in front of the sensor: Dahl friction [N]."""
    if not one(v, "friction_N"):
        return 0.0
    state = dahl(tip.position_mm, drive.first, one(v, "friction_length_mm"), one(v, "friction_start"))
    return one(v, "friction_N") * state


def on_sensor(drive: MeasuredMotion, tip: Tip, v: Fields) -> Array:
    """Force that reaches the sensor [N]: tissue, guide and the inertia of what moves in front of it."""
    return tissue(drive, tip, v) + friction(drive, tip, v) + 1e-3 * one(v, "tip_inertia_kg") * tip.acceleration_mm_s2
