"""A made axis whose friction is LuGre's, along a motion known in closed form; nothing of the project is in it."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rig.intake.axis import AxisData, AxisRecording, AxisUnits

Array = np.ndarray[Any, np.dtype[np.float64]]
RATE_HZ, DURATION_S = 250.0, 10.0
SINES = ((0.10, 0.31, 0.3), (0.05, 0.83, 1.7), (0.02, 1.9, 4.0))  # m, Hz, rad


@dataclass(frozen=True)
class MadeAxis:
    """An axis of ``inertia_kg`` with bristles of ``bristle_m``; everything else is absent at 0."""

    inertia_kg: float = 50.0
    offset_N: float = 5.0
    coulomb_N: float = 0.0
    static_N: float = 0.0  # beyond Coulomb's
    stribeck_m_s: float = 0.05
    bristle_m: float = 2e-6
    viscous_forward: float = 0.0
    viscous_backward: float = 0.0
    load_N_m: float = 0.0
    weight_N: float = 0.0
    ripple_N: float = 0.0
    ripple_m: float = 0.04
    late_s: float = 0.0
    flexible: float = 0.0
    backlash_m: float = 0.0
    compliance_m_N: float = 0.0
    noise_N: float = 0.5
    encoder_m: float = 2e-7
    drift_m_s: float = 0.0  # beside which the sines reach 0.69 m/s

    def recording(self, seed: int = 1, sees_load: bool = False, name: str = "made") -> AxisRecording:
        """Motion and effort, and where the load is where ``sees_load``."""
        rng = np.random.default_rng(seed)
        time = np.arange(0, DURATION_S, 1 / RATE_HZ)
        position, effort = self.motion(time, 0), self.effort(time + self.late_s)
        behind = self.compliance_m_N * effort + lost(position, self.backlash_m)
        load = position - behind + rng.normal(0, 2e-6, len(time))
        seen = position + rng.normal(0, self.encoder_m, len(time))
        read = effort + rng.normal(0, self.noise_N, len(time))
        return AxisRecording(name, time, seen, read, load_position=load if sees_load else None)

    def motion(self, time: Array, order: int) -> Array:
        """The ``order``-th derivative of the position [m]."""
        terms = (
            size * (2 * math.pi * f) ** order * np.sin(2 * math.pi * f * time + phase + order * math.pi / 2)
            for size, f, phase in SINES
        )
        return np.asarray(sum(terms) + self.drift_m_s * np.array((time, np.ones_like(time))[order] if order < 2 else 0))

    def effort(self, time: Array) -> Array:
        """What the drive must give [N]."""
        place, speed, acceleration = (self.motion(time, order) for order in range(3))
        drag = np.where(speed > 0, self.viscous_forward, self.viscous_backward) * speed
        held = self.load_N_m * place + self.weight_N * np.sin(place) + self.flexible * self.motion(time, 4)
        held += self.ripple_N * np.cos(2 * math.pi * place / self.ripple_m + 0.7)
        return self.inertia_kg * acceleration + self.offset_N + drag + held + self.bristles(time)

    def bristles(self, time: Array) -> Array:
        """LuGre (Canudas de Wit et al. 1995): dz/dt = v - |v| z / g(v), force by z / bristle; exact in each step."""
        strain, found = 0.0, np.zeros(len(time))
        if not self.coulomb_N:
            return found
        period = float(time[1] - time[0])
        for k, speed in enumerate(self.motion(time, 1).tolist()):
            level = 1 + self.static_N / self.coulomb_N * math.exp(-((speed / self.stribeck_m_s) ** 2))
            kept = math.exp(-abs(speed) * period / (level * self.bristle_m))
            strain = strain * kept + math.copysign(level, speed) * (1 - kept)
            found[k] = self.coulomb_N * strain
        return found


def lost(position: Array, width: float) -> Array:
    """What a load with play stays behind: it moves only where one of two stops, ``width`` apart, pushes it."""
    load, found = float(position[0]), np.empty(len(position))
    for k, place in enumerate(position.tolist()):
        load = min(max(load, place - width), place)
        found[k] = place - load
    return found


def data_of(*recordings: AxisRecording, position: str = "m", effort: str = "N") -> AxisData:
    """The recordings in these units."""
    return AxisData(recordings, AxisUnits(position, effort))


def counted(recording: AxisRecording, per_m: float, per_N: float) -> AxisRecording:
    """The same recording in other units."""
    return replace(recording, position=recording.position * per_m, effort=recording.effort * per_N)
