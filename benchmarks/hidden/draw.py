"""Which secret a seed hides, how large, and what the diagnosis must say of it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden.truth import Bench, Hidden, IndentationCycle, draw_bench, run
from rig.trials.trial import Trial, TrialSet

Truth = Mapping[str, float]


@dataclass(frozen=True)
class Secret:
    """The cause's name, its numbers for the generator, and the parameters to be found, by their name in the answer."""

    name: str
    causes: Mapping[str, Mapping[str, float]]
    expected: Truth


# Of each cause its numbers for the generator, from least to most that a lab meets, some over a divisor; then by their
# name in the answer those that are to be found.
CAUSES: Mapping[str, tuple[Mapping[str, tuple[float, ...]], Mapping[str, str]]] = {
    "friction": ({"newton": (0.03, 0.3), "mm": (0.03, 0.2)}, {"friction_N": "newton"}),
    "backlash": ({"mm": (0.05, 0.4)}, {"backlash_mm": "mm"}),
    "relaxation": ({"share": (0.05, 0.3), "tau_s": (0.15, 1.5)}, {"relaxation_ratio": "share", "tau_s": "tau_s"}),
    "rate_law": ({"exponent": (0.4, 0.75)}, {"rate_exponent": "exponent"}),
    "frame_compliance": ({"mm_per_n": (0.015, 0.06)}, {"frame_compliance_mm_N": "mm_per_n"}),
    "contact_offset": ({"mm": (0.15, 0.8)}, {"contact_offset_mm": "mm"}),
    "substrate": ({"per_mm3": (0.1, 0.5, 6.0**3)}, {"substrate_per_mm3": "per_mm3"}),
    "zero_drift": ({"n_per_h": (2.5, 12)}, {"zero_drift_N_h": "n_per_h"}),
    "time_offset": ({"s": (0.002, 0.012)}, {"time_offset_s": "s"}),
    "tracker_latency": ({"s": (0.008, 0.05)}, {"tracker_latency_s": "s"}),
    "filter_lag": ({"s": (0.003, 0.015)}, {"filter_lag_s": "s"}),
    "surface_motion": (
        {"mm": (0.05, 0.4), "hz": (0.15, 0.4), "phase": (0, 6)},
        {"surface_motion_mm": "mm", "surface_motion_Hz": "hz"},
    ),
    "preconditioning": ({"share": (0.15, 0.35), "strokes": (1.5, 4)}, {"preconditioning_gain": "share"}),
    "adhesion": ({"newton": (0.05, 0.3), "mm": (0.5, 1.5)}, {"adhesion_N": "newton", "adhesion_length_mm": "mm"}),
    "tip_inertia": ({"kg": (0.05, 0.3)}, {"tip_inertia_kg": "kg"}),
    "position_ripple": (
        {"mm": (0.02, 0.08), "pitch_mm": (1.0, 2.5), "phase": (0, 6)},
        {"ripple_mm": "mm", "ripple_pitch_mm": "pitch_mm"},
    ),
    "temperature": ({"per_kelvin": (0.04, 0.08)}, {"temperature_per_K": "per_kelvin"}),
    "elastic_law": ({"quadratic": (0.06, 0.15)}, {}),
    "unknown_depth_bump": ({"newton": (0.1, 0.3), "at_mm": (2.5, 4)}, {}),
    "unknown_speed_gain": ({"share": (0.04, 0.1)}, {}),
    "unknown_session_step": ({"share": (0.06, 0.15)}, {}),
    "hunt_crossley": ({"s_per_mm": (0.004, 0.015)}, {"hunt_crossley_s_mm": "s_per_mm"}),
    "mullins": ({"share": (0.15, 0.5), "energy": (0.2, 0.8)}, {"mullins_share": "share"}),
    "second_relaxation": (
        {"share": (0.1, 0.25), "tau_s": (0.02, 0.06)}, {"second_ratio": "share", "second_tau_s": "tau_s"},
    ),
    "third_relaxation": (
        {"share": (0.1, 0.25), "tau_s": (3.0, 10.0)}, {"third_ratio": "share", "third_tau_s": "tau_s"},
    ),
    "power_law_relaxation": ({"spread": (2.0, 4.0)}, {"relaxation_spread": "spread"}),
    "sensor_hysteresis": ({"newton": (0.05, 0.2), "width_n": (0.2, 0.6)}, {"hysteresis_N": "newton"}),
    "clock_drift": ({"ppm": (100, 600)}, {"clock_drift_ppm": "ppm"}),
    "surface_motion_harmonic": ({"mm": (0.04, 0.15), "phase": (0, 6)}, {"surface_harmonic_mm": "mm"}),
    "cogging": (
        {"newton": (0.05, 0.15), "half": (0.01, 0.04), "pitch_mm": (1.0, 2.5), "phase": (0, 6)},
        {"cogging_N": "newton", "cogging_harmonic_N": "half", "cogging_pitch_mm": "pitch_mm"},
    ),
    "cross_talk": ({"newton": (0.1, 0.4)}, {"cross_talk_N": "newton"}),
}  # fmt: skip
# What is hidden with it: a second time means nothing without a first.
BESIDE: Mapping[str, tuple[str, ...]] = {
    "second_relaxation": ("relaxation",), "third_relaxation": ("relaxation", "second_relaxation"),
    "power_law_relaxation": ("relaxation",), "surface_motion_harmonic": ("surface_motion",),
}  # fmt: skip
UNKNOWN: Mapping[str, tuple[str, ...]] = {
    "unknown_depth_bump": ("depth", "force"),
    "unknown_speed_gain": ("velocity", "speed", "force"),
    "unknown_session_step": ("session time", "cycle number", "temperature"),
}
KNOWN = tuple(cause for cause in CAUSES if cause not in UNKNOWN)


def draw_secret(rng: np.random.Generator, name: str) -> Secret:
    """Numbers of a cause, drawn over the range a lab meets; those of all others are drawn too, so that none shifts."""
    drawn = {
        cause: {number: _drawn(rng, *bounds) for number, bounds in numbers.items()}
        for cause, (numbers, _) in CAUSES.items()
    }
    if name == "none":
        return Secret(name, {}, {})
    causes = {one: drawn[one] for one in (*BESIDE.get(name, ()), name)}
    return Secret(name, causes, {parameter: drawn[name][number] for parameter, number in CAUSES[name][1].items()})


def _drawn(rng: np.random.Generator, least: float, most: float, divisor: float = 1.0) -> float:
    return rng.uniform(least, most) / divisor


def recorded(seed: int, secret: Secret, cycles: int | None = None) -> tuple[Bench, list[IndentationCycle]]:
    """A session with the secret in it."""
    rng = np.random.default_rng([seed, 77])
    bench = draw_bench(rng, cycles)
    return bench, run(bench, Hidden(secret.causes), rng)


def session_of(bench: Bench, cycles: list[IndentationCycle], stated: bool = False) -> TrialSet:
    """What the analysis is given: the devices' numbers and, where asked, the surface as somebody wrote it down."""
    trials = [
        Trial(f"trial_{k:02d}", s.time_s, s.force_n, s.axis_time_s, s.axis_mm, s.frame_time_s, s.marker_mm, s.kelvin)
        for k, s in enumerate(cycles)
    ]
    return TrialSet("hidden", tuple(trials), bench.surface if stated else None)
