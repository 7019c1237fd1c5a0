"""What the demonstration hides in the mock bench: one cause, drawn where its protocol can see it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rig.config.protocol import Indentation
from rig.diagnosis.design import check
from rig.results.diagnosis import DiagnosisResult


@dataclass(frozen=True)
class CauseRange:
    """A cause: its knob in the mock bench, its amplitude in the diagnosis, the range drawn from, further knobs."""

    knob: str
    parameter: str
    low: float
    high: float
    further: Mapping[str, tuple[float, float]]


# Small enough that fit and tracking stay what they are without it.
CAUSES = {
    "friction": CauseRange("level_N", "friction_N", 0.05, 0.15, {"slip_length_mm": (0.03, 0.1)}),
    "backlash": CauseRange("gap_mm", "backlash_mm", 0.06, 0.12, {}),
    "relaxation": CauseRange("ratio", "relaxation_ratio", 0.05, 0.1, {"time_constant_s": (0.2, 0.8)}),
    "frame_compliance": CauseRange("compliance_mm_N", "frame_compliance_mm_N", 0.02, 0.05, {}),
    "tracker_latency": CauseRange("delay_s", "tracker_latency_s", 0.015, 0.04, {}),
}
# A cause is drawn no smaller than this many times what the protocol could just show.
MARGIN = 3.0


@dataclass(frozen=True)
class HiddenCause:
    """What is hidden: the cause, its knobs with their values, and what the diagnosis calls its amplitude."""

    effect: str
    knobs: Mapping[str, float]
    parameter: str

    @property
    def hide(self) -> tuple[str, ...]:
        """As the mock bench takes it."""
        return tuple(f"{self.effect}.{knob}={value:g}" for knob, value in self.knobs.items())

    @property
    def size(self) -> float:
        """The amplitude."""
        return next(iter(self.knobs.values()))

    def is_in(self, result: DiagnosisResult) -> bool:
        """Whether the diagnosis named it, or has it among the alternatives."""
        return any(self.effect in finding.effects for finding in result.findings)

    def sentence(self, result: DiagnosisResult) -> str:
        """The truth, and how the diagnosis did."""
        hidden = f"Hidden was {self.effect} ({', '.join(f'{k} = {v:.4g}' for k, v in self.knobs.items())})"
        finding = next((found for found in result.findings if self.effect in found.effects), None)
        if finding is None:
            return f"{hidden}: the diagnosis missed it."
        how = "named it" if finding.effects[0] == self.effect else "has it among its alternatives"
        if self.parameter not in finding.parameters:
            return f"{hidden}: the diagnosis {how}."
        found = finding.parameters[self.parameter]
        inside = "holds" if found.low <= self.size <= found.high else "misses"
        return (
            f"{hidden}: the diagnosis {how}, with {self.parameter} = {found.value:.4g}; its interval "
            f"{found.low:.4g} to {found.high:.4g} {inside} the truth."
        )


def draw(rng: np.random.Generator, protocol: Indentation) -> HiddenCause:
    """One cause the protocol can see, its size well beyond the smallest visible one."""
    visible = check(protocol).detectable
    least = {name: MARGIN * visible[name].minimum for name in CAUSES if name in visible}
    names = sorted(name for name, size in least.items() if size < CAUSES[name].high)
    effect = str(rng.choice(names))
    cause = CAUSES[effect]
    size = float(rng.uniform(max(cause.low, least[effect]), cause.high))
    further = {knob: float(rng.uniform(*ends)) for knob, ends in cause.further.items()}
    return HiddenCause(
        effect, {cause.knob: round(size, 5), **{k: round(v, 5) for k, v in further.items()}}, cause.parameter
    )
