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


def draw_secret(rng: np.random.Generator, name: str) -> Secret:
    """Numbers of a cause, drawn over the range a lab meets."""
    u = rng.uniform
    drawn: dict[str, tuple[dict[str, float], dict[str, str]]] = {
        "friction": ({"newton": u(0.03, 0.3), "mm": u(0.03, 0.2)}, {"friction_N": "newton"}),
        "backlash": ({"mm": u(0.05, 0.4)}, {"backlash_mm": "mm"}),
        "relaxation": (
            {"share": u(0.05, 0.3), "tau_s": u(0.15, 1.5)}, {"relaxation_ratio": "share", "tau_s": "tau_s"},
        ),
        "rate_law": ({"exponent": u(0.4, 0.75)}, {"rate_exponent": "exponent"}),
        "frame_compliance": ({"mm_per_n": u(0.015, 0.06)}, {"frame_compliance_mm_N": "mm_per_n"}),
        "contact_offset": ({"mm": u(0.15, 0.8)}, {"contact_offset_mm": "mm"}),
        "substrate": ({"per_mm3": u(0.1, 0.5) / 6.0**3}, {"substrate_per_mm3": "per_mm3"}),
        "zero_drift": ({"n_per_h": u(2.5, 12)}, {"zero_drift_N_h": "n_per_h"}),
        "time_offset": ({"s": u(0.002, 0.012)}, {"time_offset_s": "s"}),
        "tracker_latency": ({"s": u(0.008, 0.05)}, {"tracker_latency_s": "s"}),
        "filter_lag": ({"s": u(0.003, 0.015)}, {"filter_lag_s": "s"}),
        "surface_motion": (
            {"mm": u(0.05, 0.4), "hz": u(0.15, 0.4), "phase": u(0, 6)},
            {"surface_motion_mm": "mm", "surface_motion_Hz": "hz"},
        ),
        "preconditioning": ({"share": u(0.15, 0.35), "strokes": u(1.5, 4)}, {"preconditioning_gain": "share"}),
        "adhesion": ({"newton": u(0.05, 0.3), "mm": u(0.5, 1.5)}, {"adhesion_N": "newton", "adhesion_length_mm": "mm"}),
        "tip_inertia": ({"kg": u(0.05, 0.3)}, {"tip_inertia_kg": "kg"}),
        "position_ripple": (
            {"mm": u(0.02, 0.08), "pitch_mm": u(1.0, 2.5), "phase": u(0, 6)},
            {"ripple_mm": "mm", "ripple_pitch_mm": "pitch_mm"},
        ),
        "temperature": ({"per_kelvin": u(0.04, 0.08)}, {"temperature_per_K": "per_kelvin"}),
        "elastic_law": ({"quadratic": u(0.06, 0.15)}, {}),
        "unknown_depth_bump": ({"newton": u(0.1, 0.3), "at_mm": u(2.5, 4)}, {}),
        "unknown_speed_gain": ({"share": u(0.04, 0.1)}, {}),
        "unknown_session_step": ({"share": u(0.06, 0.15)}, {}),
        "hunt_crossley": ({"s_per_mm": u(0.004, 0.015)}, {"hunt_crossley_s_mm": "s_per_mm"}),
        "mullins": ({"share": u(0.15, 0.5), "energy": u(0.2, 0.8)}, {"mullins_share": "share"}),
        "second_relaxation": (
            {"share": u(0.1, 0.25), "tau_s": u(0.02, 0.06)}, {"second_ratio": "share", "second_tau_s": "tau_s"},
        ),
        "third_relaxation": (
            {"share": u(0.1, 0.25), "tau_s": u(3.0, 10.0)}, {"third_ratio": "share", "third_tau_s": "tau_s"},
        ),
        "power_law_relaxation": (
            {"spread": u(2.0, 4.0)}, {"relaxation_spread": "spread"},
        ),
        "sensor_hysteresis": ({"newton": u(0.05, 0.2), "width_n": u(0.2, 0.6)}, {"hysteresis_N": "newton"}),
        "clock_drift": ({"ppm": u(100, 600)}, {"clock_drift_ppm": "ppm"}),
        "surface_motion_harmonic": ({"mm": u(0.04, 0.15), "phase": u(0, 6)}, {"surface_harmonic_mm": "mm"}),
        "cogging": (
            {"newton": u(0.05, 0.15), "half": u(0.01, 0.04), "pitch_mm": u(1.0, 2.5), "phase": u(0, 6)},
            {"cogging_N": "newton", "cogging_harmonic_N": "half", "cogging_pitch_mm": "pitch_mm"},
        ),
        "cross_talk": ({"newton": u(0.1, 0.4)}, {"cross_talk_N": "newton"}),
    }  # fmt: skip
    if name == "none":
        return Secret(name, {}, {})
    numbers, reported = drawn[name]
    causes = {one: drawn[one][0] for one in (*BESIDE.get(name, ()), name)}
    return Secret(name, causes, {parameter: numbers[number] for parameter, number in reported.items()})


KNOWN = (
    "friction", "backlash", "relaxation", "rate_law", "frame_compliance", "contact_offset", "substrate", "zero_drift",
    "time_offset", "tracker_latency", "filter_lag", "surface_motion", "preconditioning", "adhesion", "tip_inertia",
    "position_ripple", "temperature", "elastic_law", "hunt_crossley", "mullins", "second_relaxation",
    "third_relaxation", "power_law_relaxation", "sensor_hysteresis", "clock_drift", "surface_motion_harmonic",
    "cogging", "cross_talk",
)  # fmt: skip
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
