"""A made session on tissue: each cause by its textbook equation on a fine grid; nothing of the simulation is in it.

Arrays have shape (n,), one stroke each, at ``STEP_S``. Numbers at 0 (exponents at their linear law) are absent.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import fftconvolve, lsim
from scipy.special import erf

from rig.trials.trial import Trial, TrialSet

Array = np.ndarray[Any, np.dtype[np.float64]]
STEP_S, EVERY, TRACKER_EVERY = 5e-4, 4, 33
SURFACE_MM, CLEARANCE_MM, RETRACT_MM_S, PAUSE_S = 20.0, 2.0, 12.0, 2.0
SPEEDS_MM_S = (5.0, 20.0, 10.0, 30.0, 20.0, 5.0, 30.0, 10.0)
MIXED_MM, RISING_MM = (6.0, 4.0, 6.0, 4.5, 5.0, 6.0, 6.0, 4.0), (3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 6.5)
GRID_MM = np.linspace(0, 12, 4001)


@dataclass(frozen=True)
class MadeTissue:
    """A limb F = a x exp(b x) + B v, and what is wrong with it and with its bench."""

    a_N_mm: float = 0.2
    b_per_mm: float = 0.2
    damping_N_s_mm: float = 0.01
    power: float = 1.0  # F = a x^power with b = 0
    quadratic_N_mm2: float = 0.0
    substrate_per_mm3: float = 0.0
    rate_exponent: float = 1.0
    hunt_crossley_s_mm: float = 0.0
    mullins: tuple[float, float] = (0.0, 1.0)  # share; m over the largest energy
    first: tuple[float, float] = (0.0, 1.0)  # excess of the first cycle, and cycles
    per_K: float = 0.0
    fading: Callable[[Array], Array] | None = None  # of what a rise of force added, by the time since [s]
    adhesion: tuple[float, float] = (0.0, 1.0)  # N, mm
    backlash_mm: float = 0.0
    compliance_mm_N: float = 0.0
    ripple: tuple[float, float] = (0.0, 1.0)  # mm, pitch in mm
    surface_off_mm: float = 0.0
    breath: tuple[float, float] = (0.0, 1.0)  # mm, Hz
    uneven_breath: tuple[float, float] = (0.0, 1.0)  # mm from end to end, Hz
    friction: tuple[float, float] = (0.0, 1.0)  # N, mm
    cogging: tuple[float, float] = (0.0, 1.0)  # N, pitch in mm
    cross_talk_N: float = 0.0  # where the axis is deepest, growing with the square of its way
    mass_kg: float = 0.0
    hysteresis: tuple[float, float] = (0.0, 1.0)  # N, width in N
    lag_s: float = 0.0
    late_s: float = 0.0
    fast_ppm: float = 0.0
    tracker_late_s: float = 0.0
    drift_N_h: float = 0.0
    depths_mm: tuple[float, ...] = MIXED_MM

    def session(self, seed: int = 1, tracker: bool = False, stated: bool = False) -> TrialSet:
        """What the devices wrote of eight strokes."""
        rng, begin_s, most, trials = np.random.default_rng(seed), 0.0, 0.0, list[Trial]()
        for number, (speed, depth) in enumerate(zip(SPEEDS_MM_S, self.depths_mm, strict=True)):
            axis_mm = stroke(speed, depth)
            time_s = begin_s + np.arange(len(axis_mm), dtype=np.float64) * STEP_S
            tip_mm, force_N, most = self.readings(time_s, axis_mm, number, most)
            trials.append(self.written(number, time_s, axis_mm, tip_mm, force_N, rng, tracker))
            begin_s = float(time_s[-1]) + PAUSE_S
        return TrialSet("made", tuple(trials), SURFACE_MM if stated else None)

    def written(
        self, number: int, time_s: Array, axis_mm: Array, tip_mm: Array, force_N: Array, rng: np.random.Generator,
        tracker: bool,
    ) -> Trial:  # fmt: skip
        """Samples with noise; stamps of the force come late, and later with the time of the session."""
        stamps = time_s[::EVERY]
        late_s = self.late_s + 1e-6 * self.fast_ppm * stamps
        read_N = force_N[::EVERY] + rng.normal(0, 0.004, len(stamps))
        axis = axis_mm[::EVERY] + rng.normal(0, 1e-4, len(stamps))
        trial = Trial(f"stroke_{number}", stamps + late_s, read_N, stamps, axis, temperature_C=kelvin(stamps))
        if not tracker:
            return trial
        frames = time_s[::TRACKER_EVERY]
        along = np.interp(frames - self.tracker_late_s, time_s, tip_mm) + rng.normal(0, 0.02, len(frames))
        return replace(trial, marker_s=frames, marker_mm=np.outer(along, (0.6, 0.0, 0.8)))

    def readings(self, time_s: Array, axis_mm: Array, number: int, most: float) -> tuple[Array, Array, float]:
        """The tip, the force as converted, and the largest energy borne so far, ``most`` before."""
        tip_mm = self.tip(axis_mm)
        height, hertz = self.breath
        chest_mm, breaths_Hz = self.uneven_breath
        surface_mm = SURFACE_MM + self.surface_off_mm + height * np.sin(2 * np.pi * hertz * time_s + 0.7)
        # A chest at rest (Lujan and others 1999): (3 - 4 cos 2a + cos 4a) / 8.
        surface_mm = surface_mm - chest_mm * np.sin(np.pi * breaths_Hz * time_s + 0.3) ** 4
        depth_mm = tip_mm - surface_mm
        spring_N, most = self.spring(np.maximum(depth_mm, 0.0), most)
        excess, cycles = self.first
        spring_N = spring_N * (1 + excess * np.exp(-number / cycles)) * (1 + self.per_K * (kelvin(time_s) - WARM_C))
        push_N = self.pushed(depth_mm, spring_N) + self.pulled(depth_mm)
        dragged_N = self.sensed(push_N + self.pulled_by_magnets(axis_mm), tip_mm) + self.dragged(axis_mm)
        return tip_mm, dragged_N + 0.1 + self.drift_N_h * time_s / 3600, most

    def pulled_by_magnets(self, axis_mm: Array) -> Array:
        """Of a linear motor's pitch, with the second harmonic (Jung and others 1999)."""
        newton, pitch = self.cogging
        turn = 2 * np.pi * axis_mm / pitch + 0.4
        return np.asarray(newton * (np.sin(turn) + 0.3 * np.sin(2 * turn + 1.0)))

    def dragged(self, axis_mm: Array) -> Array:
        """By a cable that is drawn out."""
        top_mm, way_mm = SURFACE_MM - CLEARANCE_MM, CLEARANCE_MM + max(self.depths_mm)
        return np.asarray(self.cross_talk_N * ((axis_mm - top_mm) / way_mm) ** 2)

    def rest(self, depth_mm: Array) -> Array:
        """The elastic law."""
        law = self.a_N_mm * depth_mm**self.power * np.exp(self.b_per_mm * depth_mm) + self.quadratic_N_mm2 * depth_mm**2
        return np.asarray(law * (1 + self.substrate_per_mm3 * depth_mm**3))

    def spring(self, depth_mm: Array, most: float) -> tuple[Array, float]:
        """The law with Mullins' softening: (1 - erf((W_m - W) / m) / r) (Ogden and Roxburgh 1999, eq. 34)."""
        energies = cumulative_trapezoid(self.rest(GRID_MM), GRID_MM, initial=0)
        energy = np.interp(depth_mm, GRID_MM, energies)
        largest = np.maximum(np.maximum.accumulate(energy), most)
        share, m = self.mullins
        m *= float(np.interp(max(self.depths_mm), GRID_MM, energies))
        return self.rest(depth_mm) * (1 - share * erf((largest - energy) / m)), float(largest[-1])

    def pushed(self, depth_mm: Array, spring_N: Array) -> Array:
        """Fung's hereditary integral by midpoints, the damper, and no pull."""
        speed = np.gradient(depth_mm, STEP_S)
        if self.fading is not None:
            since_s = (np.arange(len(depth_mm), dtype=np.float64) + 0.5) * STEP_S
            rise_N = np.diff(spring_N, prepend=spring_N[:1])
            spring_N = spring_N + fftconvolve(rise_N, self.fading(since_s))[: len(depth_mm)]
        drag_N = self.damping_N_s_mm * 10 * np.sign(speed) * (np.abs(speed) / 10) ** self.rate_exponent
        drag_N = drag_N + self.hunt_crossley_s_mm * self.rest(np.maximum(depth_mm, 0)) * speed
        return np.asarray(np.where(depth_mm > 0, np.maximum(spring_N + drag_N, 0.0), 0.0))

    def pulled(self, depth_mm: Array) -> Array:
        """Sticking on the way out, over a Gaussian of the distance."""
        newton, reach = self.adhesion
        leaving = np.arange(len(depth_mm)) > np.argmax(depth_mm)
        out = leaving & (np.gradient(depth_mm) < 0)
        return np.asarray(-newton * np.exp(-((depth_mm / reach) ** 2)) * out)

    def tip(self, axis_mm: Array) -> Array:
        """Behind a compliant frame, a screw's error and a nut's play: it moves only where a flank pushes it."""
        if self.compliance_mm_N:
            depths = np.linspace(-5, 12, 20001)
            return np.interp(
                axis_mm, SURFACE_MM + depths + self.compliance_mm_N * self.rest(np.maximum(depths, 0)),
                SURFACE_MM + depths,
            )  # fmt: skip
        size, pitch = self.ripple
        pushed = axis_mm if not self.backlash_mm else between_flanks(axis_mm, self.backlash_mm)
        return pushed + size * np.sin(2 * np.pi * axis_mm / pitch + 0.4)

    def sensed(self, push_N: Array, tip_mm: Array) -> Array:
        """Guide, mass and sensor."""
        acceleration = np.gradient(np.gradient(tip_mm, STEP_S), STEP_S)
        force_N = push_N + self.rubbed(tip_mm) + 1e-3 * self.mass_kg * acceleration
        newton, width = self.hysteresis
        force_N = force_N + newton / width * (between_flanks(force_N, width) - force_N)
        if not self.lag_s:
            return force_N
        rest = force_N[0]
        _, behind, _ = lsim(([1.0], [self.lag_s, 1.0]), force_N - rest, np.arange(len(force_N)) * STEP_S)
        return np.asarray(rest + behind)

    def rubbed(self, tip_mm: Array) -> Array:
        """Dahl's friction of exponent one (Dahl 1976), integrated along the two ways of a stroke in closed form."""
        newton, length = self.friction
        turn = int(np.argmax(tip_mm))
        inward = 1 - 2 * np.exp(-(tip_mm[: turn + 1] - tip_mm[0]) / length)
        outward = -1 + (1 + inward[-1]) * np.exp(-(tip_mm[turn] - tip_mm[turn + 1 :]) / length)
        return np.asarray(newton * np.concatenate([inward, outward]))


WARM_C = 27.0


def kelvin(time_s: Array) -> Array:
    """A sensor that warms up by 4 K [degC]."""
    return np.asarray(25.0 + 4.0 * -np.expm1(-time_s / 15.0))


def stroke(speed_mm_s: float, depth_mm: float) -> Array:
    """The axis' way: wait, in, hold, out, wait; corners rounded over 30 ms."""
    top, way = SURFACE_MM - CLEARANCE_MM, CLEARANCE_MM + depth_mm
    corners = np.cumsum([0.0, 0.2, way / speed_mm_s, 0.5, way / RETRACT_MM_S, 0.2])
    time_s = np.arange(0, corners[-1], STEP_S)
    path = np.interp(time_s, corners, [top, top, top + way, top + way, top, top])
    kernel = np.hanning(62)[1:-1]
    return np.convolve(np.concatenate([np.full(59, top), path]), kernel / kernel.sum(), "valid")


def between_flanks(driver: Array, width: float) -> Array:
    """What lies on ``driver`` while that grows, and is ahead by ``width`` once it has come back as far."""
    place, found = float(driver[0]), np.empty_like(driver)
    for k, now in enumerate(driver.tolist()):
        place = min(max(place, now), now + width)
        found[k] = place
    return found


def exponentials(*terms: tuple[float, float]) -> Callable[[Array], Array]:
    """Prony's series of (share, time in s)."""
    return lambda t: np.asarray(sum(share * np.exp(-t / tau_s) for share, tau_s in terms))
