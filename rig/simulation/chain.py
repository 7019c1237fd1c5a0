"""The chain: measured motion -> kinematics -> environment -> tissue -> guide -> sensor -> time stamps.

The chain itself knows the axis, the contact and the elastic law with its damper. What may be wrong with a bench is an
operator of its cause at one stage (`rig.diagnosis.effects`). All are pure and vectorised over all recordings.
"""

from collections.abc import Callable, Collection
from typing import Literal, NamedTuple

import numpy as np

from rig.remembered import remembered
from rig.simulation.drive import Array, MeasuredMotion
from rig.tissue.index_law import Fields, extended_force

COMPLIANCE_ITERATIONS = 4
# Far below any depth that matters, and the difference of two forces still has half of its digits.
TANGENT_MM = 1e-3

Stage = Literal[
    "carriage", "surface", "frame", "elastic", "relaxing", "viscous", "touch", "guide", "sensing", "reading",
    "stamping", "tracking",
]  # fmt: skip
Series = Array | float


class Tip(NamedTuple):
    """The tip's motion and the surface's as far as the chain has come, each shape (n,), a number where it is constant.

    At ``carriage`` and ``surface`` it is the encoder's motion, and nothing is known of the surface.
    """

    drive: MeasuredMotion
    position_mm: Array
    velocity_mm_s: Array
    acceleration_mm_s2: Array
    surface_mm: Series = 0.0
    surface_mm_s: Series = 0.0

    @property
    def depth_mm(self) -> Array:
        """Signed distance below the surface."""
        return self.position_mm - self.surface_mm

    @property
    def indenting_mm_s(self) -> Array:
        """Velocity against the surface."""
        return self.velocity_mm_s - self.surface_mm_s

    def moved(self, offset_mm: Array) -> "Tip":
        """The motion with ``offset_mm`` added to its position."""
        rate = self.drive.rate(offset_mm)
        return self._replace(
            position_mm=self.position_mm + offset_mm,
            velocity_mm_s=self.velocity_mm_s + rate,
            acceleration_mm_s2=self.acceleration_mm_s2 + self.drive.rate(rate),
        )


class Operator(NamedTuple):
    """What a cause does at one stage: ``act(tip, signal, values)`` gives the signal as it leaves, shape (n,).

    Signals, in their order: at ``carriage``, carriage minus encoder [mm], at ``surface``, how far the surface is from
    its place [mm], at ``frame``, how far the tip stays behind the carriage for each newton [mm/N], all 0.0 where
    nothing is wrong; at ``elastic``, force of the tissue at rest [N], at ``relaxing``, the same with its past, at
    ``viscous``, what is added by the rate, at ``touch``, their sum, which only pushes; at ``guide``, the force that the
    frame carries; at ``sensing``, the force on the sensor, before its zero, at ``reading``, with its zero, at
    ``stamping``, as it carries its time stamps; at ``tracking``, how late the tracker shows the tip [s].
    """

    stage: Stage
    act: Callable[[Tip, Series, Fields], Series]


class Response(NamedTuple):
    """What the sensors would read: force on the grid, shape (n,), and the tip at the tracker's frames, shape (m,)."""

    force_N: Array
    tip_mm: Array


def one(v: Fields, name: str) -> float:
    """A parameter that is the same for all recordings."""
    return float(v[name])


def respond(drive: MeasuredMotion, values: Fields, operators: Collection[Operator] = ()) -> Response:
    """Sensor readings for the measured motion; ``operators`` of one stage act in their order."""
    chain = _Chain(values, operators)
    tip = chain.tip_of(Tip(drive, drive.position_mm, drive.velocity_mm_s, drive.acceleration_mm_s2))
    force = chain.through("sensing", tip, chain.on_frame(tip)) + values["zero_N"]
    seen = drive.at_tracker(tip.position_mm, float(chain.through("tracking", tip, 0.0))) + values["tip_zero_mm"]
    return Response(np.asarray(chain.through("stamping", tip, chain.through("reading", tip, force))), seen)


class _Chain(NamedTuple):
    values: Fields
    operators: Collection[Operator]

    def through(self, stage: Stage, tip: Tip, signal: Series) -> Series:
        for operator in self.operators:
            if operator.stage == stage:
                signal = operator.act(tip, signal, self.values)
        return signal

    def tip_of(self, encoder: Tip) -> Tip:
        """The tip's motion for that of the encoder."""
        offset, away = self.through("carriage", encoder, 0.0), self.through("surface", encoder, 0.0)
        carriage = encoder if isinstance(offset, float) else encoder.moved(offset)
        carriage = carriage._replace(
            surface_mm=self.values["surface_mm"] + away,
            surface_mm_s=0.0 if isinstance(away, float) else encoder.drive.rate(away),
        )
        compliance_mm_N = float(self.through("frame", carriage, 0.0))
        return self.behind(carriage, compliance_mm_N) if compliance_mm_N else carriage

    def behind(self, carriage: Tip, compliance_mm_N: float) -> Tip:
        """The tip behind the carriage by compliance times force: Newton with the elastic tangent, per sample."""
        tip = carriage
        for _ in range(COMPLIANCE_ITERATIONS):
            lag = carriage.position_mm - tip.position_mm
            missing = compliance_mm_N * self.on_frame(tip) - lag
            tip = carriage.moved(-(lag + missing / (1 + compliance_mm_N * self.tangent(tip.depth_mm))))
        return tip

    def elastic(self, depth_mm: Array) -> Array:
        """The tissue's force at rest [N]; none outside."""
        return extended_force(np.maximum(depth_mm, 0.0), self.values)

    def tangent(self, depth_mm: Array) -> Array:
        return (self.elastic(depth_mm + TANGENT_MM) - self.elastic(depth_mm - TANGENT_MM)) / (2 * TANGENT_MM)

    def on_frame(self, tip: Tip) -> Series:
        """Force that tissue and guide put on the frame [N]; nothing holds tip and tissue together, so they push."""
        inside, touching = contact(tip.depth_mm, tip.indenting_mm_s * tip.drive.period_s)
        force = self.through("relaxing", tip, self.through("elastic", tip, self.elastic(inside)))
        force = force + touching * self.through("viscous", tip, self.values["damping_N_s_mm"] * tip.indenting_mm_s)
        return self.through("guide", tip, self.through("touch", tip, np.maximum(force, 0.0)))


@remembered
def contact(depth_mm: Array, travel_mm: Array) -> tuple[Array, Array]:
    """Mean depth inside and share of time in contact while the tip travels by ``travel_mm`` in one sample."""
    half = np.maximum(0.5 * np.abs(travel_mm), 1e-9)
    inside, share = np.maximum(depth_mm, 0.0), np.asarray(depth_mm > 0, float)
    # Few samples cross the surface, and this is the simulation's innermost step.
    rows = np.flatnonzero(np.abs(depth_mm) < half)
    depth, reach = depth_mm[rows], half[rows]
    inside[rows], share[rows] = (depth + reach) ** 2 / (4 * reach), 0.5 + 0.5 * depth / reach
    return inside, share
