"""A servo axis in closed loop: what effort its drive would ask for, from the set-point alone.

    velocity wanted = kp (set-point - position)        control = kv (velocity wanted - velocity) + excitation, limited
    M dv/dt = effort - offset - viscous v - asymmetry |v| - load(position) - friction(v)

All in the axis' own units. The control signal is held between two samples, over which acceleration is taken as
constant; dry friction brings to rest within a step what it can hold, and opposes the motion otherwise.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.config.table import Table, parse, read_toml
from rig.intake.mapping import Controller, Positive
from rig.simulation.axis_plant import dry

Array = NDArray[np.float64]
# Beyond it the set-point's first differences are its noise, and no acceleration.
LONGEST_RUN_UP = 200


class ServoModel(Table):
    """An axis in its own units; what is not given is absent.

    ``asymmetry`` is half of what viscous friction is more forward than backward, ``position_load`` a spring about
    ``centre``, ``gravity_sin`` and ``gravity_cos`` a weight on an angle of ``angle_rad`` for one unit of position,
    ``ripple_sin`` and ``ripple_cos`` repeat every ``ripple_pitch``; ``dead_time`` is in seconds, of which half a
    sample is the hold of the command and the rest is taken as whole samples.
    """

    inertia: Positive
    offset: float = 0.0
    viscous: float = 0.0
    asymmetry: float = 0.0
    coulomb: float = 0.0
    stribeck: float = 0.0
    stribeck_speed: Positive = 1.0
    position_load: float = 0.0
    centre: float = 0.0
    gravity_sin: float = 0.0
    gravity_cos: float = 0.0
    angle_rad: Positive = 1.0
    ripple_sin: float = 0.0
    ripple_cos: float = 0.0
    ripple_pitch: Positive = 1.0
    dead_time: float = 0.0


def read_models(path: Path) -> dict[str, dict[str, float]]:
    """Models by name, a table of a TOML file each; raises UsageError naming the file, the model and the key."""
    return {name: parse(ServoModel, values, f"{path}: {name}").model_dump() for name, values in read_toml(path).items()}


def follow(
    setpoint: Array, excitation: Array | None, period_s: float, controller: Controller, values: Mapping[str, float]
) -> Array:
    """Effort at each sample, shape (n,), from rest where the set-point began to move.

    ``values`` are those of a ``ServoModel`` by name; others are passed over.
    """
    known = ServoModel.model_fields.keys() & values.keys()
    model = ServoModel.model_construct(None, **{name: values[name] for name in known})
    inertia, offset, viscous, asymmetry = model.inertia, model.offset, model.viscous, model.asymmetry
    load, grip = load_of(model), grip_of(model)
    kp, kv, limit = controller.position_gain_per_s, controller.velocity_gain, controller.limit or math.inf
    span_s = controller.velocity_samples * period_s
    late = max(0, round(model.dead_time / period_s - 0.5))
    before = run_up(setpoint)
    added = np.zeros(len(setpoint)) if excitation is None else excitation
    setpoint, added = np.concatenate([before, setpoint]), np.concatenate([np.zeros(len(before)), added])
    place, speed = float(setpoint[0]), 0.0
    past, waiting = [place] * controller.velocity_samples, [0.0] * late
    effort = np.empty(len(setpoint))
    for k, (wanted, extra) in enumerate(zip(setpoint.tolist(), added.tolist(), strict=True)):
        control = kv * (kp * (wanted - place) - (place - past[0]) / span_s) + extra
        past = [*past[1:], place]
        now = controller.effort_per_control * min(max(control, -limit), limit)
        effort[k] = now
        waiting.append(now)
        push = waiting.pop(0) - offset - load(place) - viscous * speed - asymmetry * abs(speed)
        last = speed
        speed = dry(last + period_s * push / inertia, period_s * grip(last) / inertia)
        place += period_s * (last + speed) / 2
    return effort[len(before) :]


def run_up(setpoint: Array) -> Array:
    """The set-point before its first sample, back to rest at the acceleration of its first three; often empty.

    A record that begins while the axis moves would otherwise begin with a step that never was.
    """
    first, second = np.diff(setpoint[:3])
    gained = second - first
    steps = math.floor(first / gained) if gained * first > 0 else 0
    if steps < 1 or steps > LONGEST_RUN_UP:
        return np.empty(0)
    back = np.arange(steps, 0, -1.0)
    return np.asarray(setpoint[0] - back * first + back * (back + 1) / 2 * gained)


def load_of(model: ServoModel) -> Callable[[float], float]:
    """Effort that a position asks for: spring, gravity, ripple."""
    stiffness, centre, angle_rad = model.position_load, model.centre, model.angle_rad
    up, along, sine, cosine = model.gravity_sin, model.gravity_cos, model.ripple_sin, model.ripple_cos
    if not any((stiffness, up, along, sine, cosine)):
        return lambda _: 0.0
    turn = 2 * math.pi / model.ripple_pitch

    def load(place: float) -> float:
        angle, phase = place * angle_rad, place * turn
        held = stiffness * (place - centre) + up * math.sin(angle) + along * math.cos(angle)
        return held + sine * math.sin(phase) + cosine * math.cos(phase)

    return load


def grip_of(model: ServoModel) -> Callable[[float], float]:
    """Dry friction at a speed: Coulomb's, and what Stribeck's adds at small ones."""
    coulomb, more, slow = model.coulomb, model.stribeck, model.stribeck_speed
    if not more:
        return lambda _: coulomb
    return lambda speed: coulomb + more * math.exp(-((speed / slow) ** 2))
