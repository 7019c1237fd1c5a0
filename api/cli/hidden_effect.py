"""What the demonstration hides in the mock bench: one cause, drawn where its protocol can see it, and how it was found.

The bench hides it by physics of its own; names and sizes here only say what a right answer would be.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from rig.diagnosis.estimates import Estimate, NamedCause, SmallestSize
from rig.results.diagnosis import DiagnosisResult


@dataclass(frozen=True)
class Lot:
    """A knob of the mock bench, the range it is drawn from, and what a right answer calls it and makes of its value.

    ``null`` is the answer's value where the cause is absent.
    """

    knob: str
    parameter: str
    low: float
    high: float
    told: Callable[[float], float] = float
    null: float = 0.0


THICKNESS_MM = 10.0  # of the mock bench's substrate
REFERENCE_MM_S = 10.0  # speed at which its rate law has its level
# The first number is the size. Small enough that the fit knows the damping, and so has a law to track with.
CAUSES: Mapping[str, tuple[Lot, ...]] = {
    "friction": (Lot("level_N", "friction_N", 0.05, 0.15), Lot("slip_length_mm", "friction_length_mm", 0.03, 0.1)),
    "backlash": (Lot("gap_mm", "backlash_mm", 0.06, 0.12),),
    "frame_compliance": (Lot("compliance_mm_N", "frame_compliance_mm_N", 0.02, 0.05),),
    "position_ripple": (Lot("amplitude_mm", "ripple_mm", 0.02, 0.06), Lot("period_mm", "ripple_pitch_mm", 1.0, 2.5)),
    "surface_motion": (
        Lot("amplitude_mm", "surface_motion_mm", 0.05, 0.1),
        Lot("frequency_Hz", "surface_motion_Hz", 0.2, 0.4),
    ),
    "relaxation": (Lot("ratio", "relaxation_ratio", 0.05, 0.1), Lot("time_constant_s", "tau_s", 0.2, 0.8)),
    "rate_law": (
        Lot("exponent", "rate_exponent", 0.5, 0.7, null=1.0),
        Lot("level_N", "damping_N_s_mm", 0.08, 0.12, lambda level_N: level_N / REFERENCE_MM_S),
    ),
    "elastic_law": (Lot("exponent", "exponent", 1.7, 2.1, null=1.0),),
    "substrate": (Lot("strength", "substrate_per_mm3", 0.1, 0.3, lambda strength: strength / THICKNESS_MM**3),),
    "preconditioning": (  # the knob is the first cycle over the last, less one; softening what the last has lost of it
        Lot("softening", "preconditioning_gain", 0.1, 0.2, lambda share: share / (1 - share)),
        Lot("cycles", "preconditioning_cycles", 1.5, 4.0),
    ),
    "adhesion": (Lot("level_N", "adhesion_N", 0.05, 0.15), Lot("length_mm", "adhesion_length_mm", 0.5, 1.5)),
    "hunt_crossley": (Lot("damping_s_mm", "hunt_crossley_s_mm", 0.01, 0.015),),
    "mullins": (Lot("softening", "mullins_share", 0.1, 0.2),),
    "sensor_hysteresis": (Lot("level_N", "hysteresis_N", 0.05, 0.15), Lot("width_N", "hysteresis_width_N", 0.3, 0.8)),
    "clock_drift": (Lot("gain_ppm", "clock_drift_ppm", 40.0, 80.0),),
    "tip_inertia": (Lot("mass_kg", "tip_inertia_kg", 0.02, 0.06),),
    "filter_lag": (Lot("time_constant_s", "filter_lag_s", 0.003, 0.006),),
    "time_offset": (Lot("delay_s", "time_offset_s", 0.003, 0.008),),
    "zero_drift": (Lot("rate_N_h", "zero_drift_N_h", 8.0, 15.0),),
    "tracker_latency": (Lot("delay_s", "tracker_latency_s", 0.015, 0.04),),
}
# Nothing recovers within a demonstration: the library knows of no rest that makes softening forgotten. What was borne
# reaches as far as a depth on the bench, and as an energy in an answer.
BESIDE: Mapping[str, Mapping[str, float]] = {"preconditioning": {"recovery_s": 1e6}, "mullins": {"reach_mm": 5.0}}
# A cause is drawn no smaller than this many times what the protocol could just show.
MARGIN = 3.0
DIGITS = 5


@dataclass(frozen=True)
class HiddenCause:
    """What is hidden: the cause, its knobs with their values, and the parameters of a right answer."""

    effect: str
    knobs: Mapping[str, float]
    expected: Mapping[str, float] = field(default_factory=dict)

    @property
    def hide(self) -> tuple[str, ...]:
        """As the mock bench takes it."""
        knobs = {**self.knobs, **BESIDE.get(self.effect, {})}
        return tuple(f"{self.effect}.{knob}={value:g}" for knob, value in knobs.items())

    def found_in(self, result: DiagnosisResult) -> NamedCause | None:
        """The finding that names it, alone or among others that cannot be told apart."""
        return next((found for found in result.findings if self.effect in found.effects), None)

    def inside(self, result: DiagnosisResult) -> dict[str, bool]:
        """By parameter, whether the answer's interval holds what was hidden; False where the answer has none."""
        return {
            name: (size := self._size(name, result)) is not None and size.low <= value <= size.high
            for name, value in self.expected.items()
        }

    def _size(self, name: str, result: DiagnosisResult) -> Estimate | None:
        finding = self.found_in(result)
        return None if finding is None else {**result.parameters, **finding.parameters}.get(name)

    def sentence(self, result: DiagnosisResult) -> str:
        """The truth, and how the diagnosis did with the name and with every number."""
        knobs = ", ".join(f"{knob} = {value:.4g}" for knob, value in self.knobs.items())
        return f"Hidden was {self.effect} ({knobs}): {'; '.join(self._judged(result))}."

    def _judged(self, result: DiagnosisResult) -> Iterator[str]:
        finding, inside = self.found_in(result), self.inside(result)
        if finding is None:
            reason = result.not_testable.get(self.effect)
            yield "the diagnosis did not find it" + (f", which it could not test: {reason}" if reason else "")
        else:
            provisional = " provisionally" * finding.provisional
            how = "named it" if finding.effects[0] == self.effect else "has it in its set"
            yield f"the diagnosis {how}{provisional}"
            yield from (self._compared(name, self._size(name, result), holds) for name, holds in inside.items())
        others = [found.effects[0] for found in result.findings if found is not finding]
        if others:
            yield f"it also named {', '.join(others)}, which was not hidden"
        right = finding is not None and all(inside.values()) and not others
        yield "name and every size are right" if right else "not all of it was found"

    def _compared(self, name: str, size: Estimate | None, holds: bool) -> str:
        if size is None:
            return f"{name} = {self.expected[name]:.4g} was not found"
        interval = f"{size.low:.4g} to {size.high:.4g} {'holds' if holds else 'misses'}"
        return f"{name} {size.value:.4g}, whose interval {interval} {self.expected[name]:.4g}"


def draw(rng: np.random.Generator, visible: Mapping[str, SmallestSize]) -> HiddenCause:
    """One of all causes that are visible from some size in a protocol, its size well beyond that."""
    least = {name: MARGIN * visible[name].minimum for name in CAUSES if name in visible}
    effect = str(rng.choice(sorted(name for name in least if _reach(CAUSES[name][0]) > least[name])))
    size, *others = CAUSES[effect]
    knobs = {size.knob: _drawn(rng, size, least[effect])} | {other.knob: _drawn(rng, other) for other in others}
    return HiddenCause(effect, knobs, {one.parameter: one.told(knobs[one.knob]) for one in CAUSES[effect]})


def _reach(size: Lot) -> float:
    """How far from absent the range goes."""
    return max(abs(size.told(end) - size.null) for end in (size.low, size.high))


def _drawn(rng: np.random.Generator, number: Lot, least: float = 0.0) -> float:
    """A value of the range that is at least so far from absent."""
    while True:
        value = round(float(rng.uniform(number.low, number.high)), DIGITS)
        if abs(number.told(value) - number.null) >= least:
            return value
