"""A drive axis as a problem: motion in, effort out, judged by the same engine as the tissue.

The simulation as it is: effort = inertia x acceleration + offset, and the causes it is said to know. All rows and
parameters are without unit, so that the answer is the same in millimetres, metres, radians or counts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rig.diagnosis.axis_motion import Mask, Motion, Scales, noise_of
from rig.diagnosis.effects.axis import AXIS_CAUSES, AxisEffect
from rig.diagnosis.problem import Array, Par, Scatter, Signal, Values
from rig.tissue.index_law import Fields

MOST_NOISE = 0.2  # of what stands on one side of a regression, which then comes out 4 % too small
MEMORY_ROWS = 5.0  # of the noise; what lasts longer is an error to be explained

INERTIA = Par("inertia", "effort s2/position", 0.5, -10.0, 100.0, 0.02, meaning="moved mass or inertia")
OFFSET = Par("offset", "effort", 0.0, -100.0, 100.0, 0.02, meaning="constant load, or zero of the effort")
LOAD_ZERO = Par("load_zero", "position", 0.0, -1e9, 1e9, 2e-3, meaning="zero of the load's encoder")
LOAD_RATIO = Par("load_ratio", "1", 0.0, -10.0, 10.0, 2e-3, meaning="load's way beyond the drive's, as a share of it")


@dataclass(frozen=True)
class AxisProblem:
    """Recordings of an axis in blocks that are left out in turn; ``lacks`` are needs that are not met, and why."""

    motion: Motion
    scales: Scales
    known: tuple[str, ...] = ()
    lacks: Mapping[str, str] | None = None

    @property
    def title(self) -> str:
        """Which simulation is judged."""
        return "axis"

    @cached_property
    def channels(self) -> tuple[Signal, ...]:
        """Effort, and what the load is ahead of the drive where it has an encoder."""
        m, s = self.motion, self.scales
        effort = Signal("effort", f"{s.effort:.4g} {s.units.effort}", m.effort, m.block, MEMORY_ROWS)
        if not self.has_load:
            return (effort,)
        return effort, Signal("slip", f"{s.position:.4g} {s.units.position}", m.slip, m.block, MEMORY_ROWS)

    @property
    def has_load(self) -> bool:
        """Whether a second encoder sees the load in every recording."""
        return bool(np.isfinite(self.motion.slip).all())

    @property
    def recordings(self) -> int:
        """Blocks."""
        return int(self.motion.block[-1]) + 1

    @cached_property
    def base(self) -> tuple[Par, ...]:
        """Inertia, offset, what is known, and the second encoder's zero and scale."""
        known = [par for name in self.known for par in AXIS_CAUSES.named(name).pars]
        return (INERTIA, OFFSET, *known, *((LOAD_ZERO, LOAD_RATIO) if self.has_load else ()))

    @cached_property
    def effects(self) -> tuple[AxisEffect, ...]:
        """The library without what is known."""
        return tuple(cause for name, cause in AXIS_CAUSES.items() if name not in self.known)

    @property
    def scatter(self) -> tuple[Scatter, ...]:
        """An axis is the same in all blocks."""
        return ()

    @cached_property
    def offers(self) -> Mapping[str, str]:
        """Why a need is not met, by need."""
        found = dict(self.lacks or {})
        if not self.has_load:
            found["tracker"] = "no second encoder sees the load"
        if not np.isfinite(self.motion.angle_rad).all():
            found["angle"] = "the position is no angle"
        if noise_of(self.motion.snap) > MOST_NOISE * float(np.std(self.motion.snap)):
            found["smooth"] = "the fourth derivative of the position is lost in noise"
        return found

    @property
    def labels(self) -> Mapping[str, Sequence[str]]:
        """None: blocks of one axis."""
        return {}

    def start(self) -> Values:
        """Linear least squares of what the simulation knows."""
        m = self.motion
        moving = ~self.blind({})
        rows = np.stack([m.acceleration, m.velocity, np.ones_like(m.effort)], axis=1)[moving]
        inertia, viscous, offset = np.linalg.lstsq(rows, m.effort[moving], rcond=None)[0]
        found = {"inertia": inertia, "offset": offset, "viscous": viscous if "viscous_friction" in self.known else 0.0}
        if self.has_load:
            found["load_zero"] = np.median(m.slip)
        return {**self._nulls, **{name: float(value) for name, value in found.items()}}

    @cached_property
    def _nulls(self) -> dict[str, float]:
        pars = (*(par for cause in AXIS_CAUSES.values() for par in cause.pars), *self.base)
        return {par.name: par.null for par in pars}

    def predict(self, values: Fields) -> tuple[Array, ...]:
        """Effort the drive must give for this motion, and where the load then is."""
        m, v = self.motion, {**self._nulls, **values}
        effort = np.asarray(v["inertia"] * m.acceleration + v["offset"])
        slip = np.asarray(v["load_zero"] + v["load_ratio"] * m.position) if self.has_load else m.slip
        for cause in AXIS_CAUSES.values():
            if all(v[par.name] == par.null for par in cause.amplitudes):
                continue
            if cause.on_load:
                slip = cause.act(m, slip, v)
            else:
                effort = cause.act(m, effort, v)
        return (effort, slip) if self.has_load else (effort,)

    def blind(self, values: Fields) -> Mask:  # noqa: ARG002 - where it stands still is known beforehand
        """Standstill, where dry friction is whatever holds the axis, and rows on missing samples."""
        return self.motion.blind

    @property
    def units(self) -> Mapping[str, str]:
        """Of the variables."""
        s = self.scales
        return {
            "position": f"{s.position:.4g} {s.units.position}",
            "velocity": f"{s.speed:.4g} {s.units.position}/s",
            "acceleration": f"{s.acceleration:.4g} {s.units.position}/s2",
            "session time": f"{s.time_s:.4g} s",
            "force": f"{s.effort:.4g} {s.units.effort}",
        }

    def variables(self) -> Mapping[str, Array]:
        """What a residual may depend on."""
        m = self.motion
        return {
            "position": m.position, "velocity": m.velocity, "acceleration": m.acceleration, "session time": m.time
        }  # fmt: skip
