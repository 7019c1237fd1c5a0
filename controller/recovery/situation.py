"""The way back after a crash or a fault: what is left to be done, one consent for each thing that acts on the bench.

Pure. The order is: clear the drive's fault, bring the tip out of the tissue, find the reference where it was lost,
acknowledge. A valid reference is kept: nothing is homed without need, and nothing is homed with the tip inside.
"""

from dataclasses import dataclass

from rig.config.wiring import Limits
from rig.results.bench import Act, Question

# A hold ripples by hundredths of a millimetre; no tissue is that near to home.
RETRACTED_MM = 1.0


@dataclass(frozen=True)
class Situation:
    """What a loop at rest found; ``position_mm`` is None without a reference, ``force_N`` without a sensor.

    ``history``: the drive's own errors in words, newest first. ``stopped``: the stop in force. ``lost``: why the axis
    does not answer.
    """

    stopped: str
    lost: str
    fault: str
    history: tuple[str, ...]
    referenced: bool
    retracted: bool
    outward: bool
    position_mm: float | None
    force_N: float | None

    @property
    def sentences(self) -> tuple[str, ...]:
        """What happened and where things stand, for a person."""
        place = "without a reference" if self.position_mm is None else f"at {self.position_mm:.2f} mm"
        force = "unknown" if self.force_N is None else f"{self.force_N:.2f} N"
        said = [
            self.stopped,
            self.lost and f"the axis does not answer: {self.lost}",
            self.fault and f"the drive is in fault: {self.fault}",
            self.history and f"the drive remembers: {'; '.join(dict.fromkeys(self.history))}",
            f"the axis stands {place}, force {force}",
        ]
        return tuple(sentence for sentence in said if sentence)


@dataclass(frozen=True)
class Consent:
    """What a person has agreed to."""

    clear: bool = False
    retract: bool = False
    home: bool = False

    def to(self, act: Act) -> bool:
        """Whether ``act`` may be done."""
        return bool(getattr(self, act))


ALL = Consent(clear=True, retract=True, home=True)


def needed(now: Situation) -> tuple[Act, ...]:
    """The acts that are needed for the next thing to be done; none where only the acknowledgement is left."""
    if now.fault:
        return ("clear",)
    if not now.referenced:
        return ("retract", "home") if now.outward else ("home",)
    return () if now.retracted else ("retract",)


def question(act: Act, now: Situation) -> str:
    """What a person is asked."""
    if act == "clear":
        return f"may the drive's fault ({now.fault}) be cleared?"
    if act == "retract" and now.referenced:
        return f"may the tip move out, from {now.position_mm:.1f} mm to its end position?"
    if act == "retract":
        return "may the tip move out until the reference switch? the axis has no reference"
    if now.outward:
        return "may the axis be homed?"
    return "is the tip out of the tissue, and may the axis be homed? its search may lead into it"


def questions(now: Situation, consent: Consent) -> tuple[Question, ...]:
    """The consents still needed for the next thing to be done."""
    return tuple(Question(act=act, question=question(act, now)) for act in needed(now) if not consent.to(act))


def is_retracted(position_mm: float, limits: Limits) -> bool:
    """Whether the tip stands at the outer end of its way."""
    return position_mm <= limits.position_min_mm + RETRACTED_MM
