"""Causes for which the effort of a drive axis is not that of a mass: friction, loads, lost motion, delay.

Parameters have no unit inside; what is declared as theirs is what they are of (`rig.diagnosis.axis_motion.Scales`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from rig.diagnosis.axis_motion import Motion
from rig.diagnosis.effects.scan import PEAKS, peaks
from rig.diagnosis.problem import Array, Effect, InverseProblem, Par, Values
from rig.plugins import instance_of
from rig.registry import Registry
from rig.simulation.scans import play
from rig.tissue.index_law import Fields

Act = Callable[[Motion, Array, Fields], Array]
FEWEST_PERIODS = 2.5  # over the motion: of fewer, other loads along the axis take the place
SHORTEST = 1 / 200  # of the motion; of three rows at full speed where that is longer
# No feed-forward is better than half a percent of the effort's range, nor is a drive's torque constant.
LEAST = 0.005


@dataclass(frozen=True)
class AxisEffect(Effect):
    """A cause and what it does: ``act(motion, signal, values)`` gives the effort, or the load's slip, as it leaves."""

    act: Act = lambda _motion, signal, _values: signal
    on_load: bool = False


def _number(values: Fields, name: str) -> float:
    return float(np.asarray(values[name]).flat[0])


def _pitches(problem: InverseProblem) -> Array:
    """Pitches worth trying, as turns over the whole motion."""
    along = problem.variables()["position"]
    shortest = max(SHORTEST, 3 * float(np.quantile(np.abs(np.diff(along)), 0.99)))
    return np.arange(FEWEST_PERIODS, max(1 / shortest, 2 * FEWEST_PERIODS), 0.5)


def _ripple_starts(problem: InverseProblem, _: Values, residual: Array) -> Sequence[Values]:
    along = problem.variables()["position"]
    left = np.where(problem.blind({}), 0.0, residual)
    return [{"ripple_pitch": 1 / turns} for turns in peaks(along, left, float(len(left)), _pitches(problem))]


def _ripple_tries(problem: InverseProblem) -> float:
    return max(1.0, len(_pitches(problem)) / PEAKS)


def _ripple(motion: Motion, effort: Array, v: Fields) -> Array:
    phase = 2 * np.pi * motion.position / v["ripple_pitch"]
    return np.asarray(effort + v["ripple_sin"] * np.sin(phase) + v["ripple_cos"] * np.cos(phase))


def _gravity(motion: Motion, effort: Array, v: Fields) -> Array:
    pull = v["gravity_sin"] * np.sin(motion.angle_rad) + v["gravity_cos"] * np.cos(motion.angle_rad)
    return np.asarray(effort + pull)


def _stribeck(motion: Motion, effort: Array, v: Fields) -> Array:
    slow = np.exp(-((motion.velocity / v["stribeck_speed"]) ** 2))
    return np.asarray(effort + v["stribeck"] * slow * motion.direction)


def _early(motion: Motion, effort: Array, v: Fields) -> Array:
    # Linear between rows it would be a low-pass too, which a delay must not be.
    return np.asarray(CubicSpline(motion.time, effort)(motion.time + _number(v, "dead_time")))


def _backlash(motion: Motion, slip: Array, v: Fields) -> Array:
    return np.asarray(slip + play(motion.position, motion.first, _number(v, "backlash")) - motion.position)


COULOMB = AxisEffect(
    "coulomb_friction",
    "the axis has Coulomb friction of {coulomb:.3g} [effort] whatever its speed",
    (Par("coulomb", "effort", 0.0, 0.0, 10.0, 0.02, least=LEAST, meaning="Coulomb friction"),),
    one_sided=True,
    act=lambda m, effort, v: np.asarray(effort + v["coulomb"] * m.direction),
    needs=frozenset({"both ways"}),
    control="in the feed-forward, with the sign of the velocity that is wanted",
    repair="add Coulomb friction to the feed-forward",
)
VISCOUS = AxisEffect(
    "viscous_friction",
    "the axis is braked by {viscous:.3g} [effort s/position]",
    (Par("viscous", "effort s/position", 0.0, -10.0, 10.0, 0.02, least=LEAST, meaning="viscous friction"),),
    one_sided=True,
    act=lambda m, effort, v: np.asarray(effort + v["viscous"] * m.velocity),
    control="in the feed-forward, with the velocity that is wanted",
    repair="add viscous friction to the feed-forward",
)
ASYMMETRIC = AxisEffect(
    "asymmetric_friction",
    "friction grows with speed by {asymmetry:+.3g} [effort s/position] forward and as much the other way backward",
    (Par("asymmetry", "effort s/position", 0.0, -10.0, 10.0, 0.02, least=LEAST, meaning="half of the difference"),),
    act=lambda m, effort, v: np.asarray(effort + v["asymmetry"] * np.abs(m.velocity)),
    needs=frozenset({"both ways"}),
    control="in the feed-forward, a viscous friction for each direction",
    repair="use friction parameters of their own for each direction",
)
STRIBECK = AxisEffect(
    "stribeck_friction",
    "dry friction is larger by {stribeck:.3g} [effort] at speeds below {stribeck_speed:.3g} [speed]",
    (Par("stribeck", "effort", 0.0, 0.0, 10.0, 0.02, least=LEAST, meaning="friction at rest beyond Coulomb's"),),
    (Par("stribeck_speed", "speed", 0.1, 0.005, 0.6, 1.0, log=True, meaning="speed at which 1/e of it is left"),),
    lambda *_: [{"stribeck_speed": speed} for speed in (0.02, 0.06, 0.15, 0.35)],
    one_sided=True,
    act=_stribeck,
    needs=frozenset({"both ways"}),
    control="in the feed-forward; it falls with speed, so a stiff position loop is needed against stick-slip",
    repair="lubricate the guides, or add Stribeck friction to the feed-forward",
)
POSITION_LOAD = AxisEffect(
    "position_load",
    "the load grows by {position_load:+.3g} [effort/position] along the axis",
    (Par("position_load", "effort/position", 0.0, -10.0, 10.0, 0.02, least=LEAST, meaning="load per position"),),
    act=lambda m, effort, v: np.asarray(effort + v["position_load"] * m.position),
    control="in the feed-forward, with the position that is wanted",
    repair="balance the axis, free its cables, or add the load to the feed-forward",
)
GRAVITY = AxisEffect(
    "gravity",
    "a weight turns with the axis and pulls with up to {amplitude:.3g} [effort]",
    (
        Par("gravity_sin", "effort", 0.0, -100.0, 100.0, 0.02, least=LEAST, meaning="weight off the axis of rotation"),
        Par("gravity_cos", "effort", 0.0, -100.0, 100.0, 0.02, least=LEAST, meaning="weight off the axis of rotation"),
    ),
    act=_gravity,
    needs=frozenset({"angle"}),
    control="in the feed-forward, with the angle that is wanted",
    repair="balance the axis, or add the weight to the feed-forward",
)
POSITION_RIPPLE = AxisEffect(
    "position_ripple",
    "the effort ripples by {amplitude:.3g} [effort] every {ripple_pitch:.3g} [position] (cogging, or the screw)",
    (
        Par("ripple_sin", "effort", 0.0, -10.0, 10.0, 0.02, least=LEAST, meaning="ripple along the axis"),
        Par("ripple_cos", "effort", 0.0, -10.0, 10.0, 0.02, least=LEAST, meaning="ripple along the axis"),
    ),
    (Par("ripple_pitch", "position", 0.05, 0.002, 0.5, 1e-3, meaning="period along the axis"),),
    _ripple_starts,
    _ripple_tries,
    act=_ripple,
    control="in the feed-forward, once its phase is known to the encoder's index",
    repair="compensate the ripple along the axis",
)
DEAD_TIME = AxisEffect(
    "dead_time",
    "the effort acts {dead_time:.3g} [s] after its command",
    # A hundredth of the time in which it speeds up: less is the hold of a sampled command, half a period long.
    (Par("dead_time", "s", 0.0, -1.0, 1.0, 0.01, least=0.01, meaning="delay of the effort"),),
    act=_early,
    needs=frozenset({"one clock"}),
    control="none: it bounds the gains of every loop around it",
    repair="add the delay to the controller's design",
)
FLEXIBLE_MODE = AxisEffect(
    "flexible_mode",
    "a flexible mode adds {flexible:.3g} [effort s4/position] times the fourth derivative of position",
    (Par("flexible", "effort s4/position", 0.0, 0.0, 10.0, 1e-3, least=1e-3, meaning="inertia by resonance squared"),),
    one_sided=True,
    act=lambda m, effort, v: np.asarray(effort + v["flexible"] * m.snap),
    needs=frozenset({"one clock", "smooth"}),
    control="none: it bounds the gains of every loop around it",
    repair="filter the command at the resonance",
)
BACKLASH = AxisEffect(
    "backlash", "the load follows the drive with a dead band of {backlash:.3g} [position]",
    (Par("backlash", "position", 0.0, 0.0, 0.5, 2e-3, least=2e-4, meaning="dead band between drive and load"),),
    begin={"backlash": 5e-3}, one_sided=True, act=_backlash, on_load=True, needs=frozenset({"tracker"}),
    control="none: close the position loop on the load, or approach from one side",
    repair="preload the gear or the nut; or close the loop on the load's encoder",
)  # fmt: skip
COMPLIANCE = AxisEffect(
    "transmission_compliance", "the transmission gives way by {compliance:.3g} [position/effort]",
    (Par("compliance", "position/effort", 0.0, 0.0, 0.5, 2e-3, least=2e-4, meaning="load behind drive per effort"),),
    one_sided=True, act=lambda m, slip, v: np.asarray(slip - v["compliance"] * m.effort), on_load=True,
    needs=frozenset({"tracker"}),
    control="none: it bounds the stiffness that a loop on the drive's encoder gives the load",
    repair="stiffen the transmission, or close the loop on the load's encoder",
)  # fmt: skip
AXIS_EFFECTS = (
    COULOMB, VISCOUS, ASYMMETRIC, STRIBECK, POSITION_LOAD, GRAVITY, POSITION_RIPPLE, DEAD_TIME, FLEXIBLE_MODE, BACKLASH,
    COMPLIANCE,
)  # fmt: skip
AXIS_CAUSES = Registry[AxisEffect](
    "cause of an axis", lambda cause: cause.name, AXIS_EFFECTS, "tissue_rig.axis_cause", instance_of(AxisEffect)
)
