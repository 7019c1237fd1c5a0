"""What the force law reaches in simulation on five subjects."""

from functools import cache
from typing import Any

import numpy as np

from controller.experiments import comparison, tracking
from controller.loop.steps import TrackForce
from controller.simulated.bench import SENSING, SimulatedBench, follow, limb_of
from mock_devices.testing.made.subjects import NAMES, RESPONSE, subject
from rig.config.wiring import Wiring

WIRING = Wiring()
FORCES_N = (0.5, 1.0, 2.0, 5.0, 10.0)
QUIET = SENSING._replace(noise_N=0.0, quantum_N=0.0)


@cache
def law(name: str) -> TrackForce:
    """Of one subject, as `rig track` would take it."""
    return tracking.force_law(subject(name), WIRING, RESPONSE)


def changed(name: str, **values: Any) -> TrackForce:
    """The law with a bug: data that no step would be made with are not checked."""
    return law(name).model_copy(update=values)


def rms_mN(step: TrackForce, name: str, force_N: float, **motion: float) -> float:
    """Error of a constant force after it has settled."""
    trace = follow(step, np.full(6000, force_N), SimulatedBench(limb_of(subject(name), **motion)))
    return 1000 * float(np.sqrt(np.mean((trace.force_N[2000:] - force_N) ** 2)))


def moved_mN(force_N: float, **values: Any) -> float:
    """The worst of all subjects, whose surface moves by 0.5 mm at 2 Hz."""
    motion = {"breathing_mm": 0.5, "breathing_Hz": 2.0}
    return max(rms_mN(changed(name, **values), name, force_N, **motion) for name in NAMES)


def breathing_mN(name: str, force_N: float) -> float:
    """Error of a constant force, without the sensor's noise."""
    limb = limb_of(subject(name), breathing_mm=1.5, breathing_Hz=0.25)
    trace = follow(law(name), np.full(6000, force_N), SimulatedBench(limb, sensing=QUIET))
    return 1000 * float(np.sqrt(np.mean((trace.force_N[2000:] - force_N) ** 2)))


def peak(step: TrackForce, name: str, force_N: float = 0.3) -> float:
    """Of a contact after 1 mm of air, over the force asked for."""
    bench = SimulatedBench(limb_of(subject(name)))
    trace = follow(step, np.full(3000, force_N), bench, clearance_mm=1.0)
    return float(np.max(trace.force_N)) / force_N


def jumps(step: TrackForce, name: str, levels_N: tuple[float, ...], stiffness: float) -> tuple[float, float]:
    """Worst overshoot [%] and settling [s] of jumps through the levels."""
    trace = follow(step, np.repeat(levels_N, 1500), SimulatedBench(limb_of(subject(name), stiffness)))
    found = comparison.jumps(trace.time_s, trace.reference_N, trace.sensed_N, trace.mode)
    assert None not in [jump.settling_s for jump in found], (name, stiffness)
    return max(jump.overshoot_percent for jump in found), max(jump.settling_s or 0.0 for jump in found)


def low_jumps(name: str, stiffness: float) -> tuple[float, float]:
    """Worst overshoot of 0.3 N [%] and time until 0.02 N are left [s]; 2 % are the sensor's noise: without it."""
    levels_N = (0.3, 0.6, 0.9, 1.2, 1.5)
    bench = SimulatedBench(limb_of(subject(name), stiffness), sensing=QUIET)
    force_N = follow(law(name), np.repeat(levels_N, 1500), bench).force_N.reshape(len(levels_N), 1500)
    error_N = (force_N - np.array(levels_N)[:, None])[1:]
    outside = np.flatnonzero((np.abs(error_N) >= 0.02).any(axis=0))
    return 100 * float(error_N.max()) / 0.3, 1e-3 * (1 + int(outside.max(initial=-1)))


def sine_mN(name: str, frequency_Hz: float, stiffness: float, **values: Any) -> float:
    """Error of 0.5 N about 2 N after it has settled."""
    step = changed(name, **values)
    time_s = np.arange(5000) * 1e-3
    asked_N, given_N = (
        2.0 + 0.5 * np.sin(2 * np.pi * frequency_Hz * (time_s + early_s)) for early_s in (step.preview_s, 0.0)
    )
    trace = follow(step, asked_N, SimulatedBench(limb_of(subject(name), stiffness)))
    return 1000 * float(np.sqrt(np.mean((trace.force_N - given_N)[2000:] ** 2)))
