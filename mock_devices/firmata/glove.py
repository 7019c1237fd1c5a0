"""A glove on somebody's hand: forces under its fingers, and what a force-sensing resistor in a divider makes of them.

The resistor's conductance grows with force, so that the divider's share of the supply is F / (F + F_half); it has
nothing of the straight lines that a calibration draws between its weights.
"""

import random
from dataclasses import dataclass, field
from typing import NamedTuple

COUNTS_MAX = 1023


@dataclass(frozen=True)
class GloveFigures:
    """Of the resistors, the hand in the glove, and how somebody presses who looks for pain.

    Before the first press comes ``lead_s``, in which a client starts the board.
    """

    half_N: float = 12.0
    fabric_N: float = 0.5
    noise_counts: float = 0.6
    rate_N_s: float = 4.0
    release_s: float = 0.25
    pause_s: float = 1.0
    lead_s: float = 4.0
    rest_s: float = 0.2


class HandPress(NamedTuple):
    """One press: rises to ``peak_N`` at a steady rate, rests there, and is let go."""

    begin_s: float
    peak_N: float


@dataclass
class GlovePlant:
    """The glove; ``weights_N`` lie on its fingers by number, ``presses`` come under all of them in equal shares."""

    fingers: int = 3
    figures: GloveFigures = GloveFigures()
    seed: int = 0
    weights_N: dict[int, float] = field(default_factory=dict)
    cut: set[int] = field(default_factory=set)
    presses: tuple[HandPress, ...] = ()

    def __post_init__(self) -> None:
        self._rng = random.Random(self.seed)

    def press(self, peaks_N: tuple[float, ...], from_s: float) -> None:
        """Presses one after another, from ``from_s`` on."""
        begin_s, planned = from_s + self.figures.lead_s, []
        for peak_N in peaks_N:
            planned.append(HandPress(begin_s, peak_N))
            begin_s += peak_N / self.figures.rate_N_s + self.figures.rest_s + self.figures.release_s
            begin_s += self.figures.pause_s
        self.presses = tuple(planned)

    def pressed_N(self, time_s: float) -> float:
        """Force of the whole hand."""
        return max((self._of(press, time_s) for press in self.presses), default=0.0)

    def _of(self, press: HandPress, time_s: float) -> float:
        figures = self.figures
        since_s = time_s - press.begin_s
        top_s = press.peak_N / figures.rate_N_s
        falling_s = since_s - top_s - figures.rest_s
        if since_s <= 0 or falling_s >= figures.release_s:
            return 0.0
        rising_N = min(since_s * figures.rate_N_s, press.peak_N)
        return rising_N if falling_s <= 0 else press.peak_N * (1 - falling_s / figures.release_s)

    def counts(self, finger: int, time_s: float) -> int:
        """What the converter of a finger reads now; a cut wire leaves the divider's foot."""
        if finger in self.cut or finger >= self.fingers:
            return 0
        figures = self.figures
        force_N = figures.fabric_N + self.weights_N.get(finger, 0.0) + self.pressed_N(time_s) / self.fingers
        share = force_N / (force_N + figures.half_N)
        noisy = COUNTS_MAX * share + self._rng.gauss(0.0, figures.noise_counts)
        return min(max(round(noisy), 0), COUNTS_MAX)
