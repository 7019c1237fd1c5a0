"""Pain by a glove: one press after another, each let go at the subject's word, and the value that three of them give.

Pure: samples in, presses out; the rule that chooses stands here and is written beside every value.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from statistics import median

# Above the noise of a calibrated finger (0.1 N) and what the fabric does, below what anybody calls a press.
BEGIN_N = 1.0
END_N = 0.5 * BEGIN_N
# A knock is shorter; at 50 Hz fifteen samples then follow the rise.
LEAST_S = 0.3
PRESSES = 3
# One examiner finds a pain threshold again to about a tenth (standard deviation) within a session: a quarter off is two
# and a half of these, so that of a hundred sound presses one is asked for again.
SPREAD = 0.25
# Five presses too many hurt more than the answer is worth.
MOST = 8
RULE = f"median of {PRESSES} peaks, none farther than {SPREAD:.0%} from it; one that is, is refused and repeated"


@dataclass(frozen=True)
class GlovePress:
    """One press; ``refused`` says why it does not count, and is empty where it does."""

    peak_N: float
    seconds: float
    refused: str = ""


class PressFinder:
    """Finds presses in forces as they come; ``force_N`` None where a finger's force is not known."""

    def __init__(self) -> None:
        self._begun_ns: int | None = None
        self._peak_N, self._unknown = 0.0, False

    @property
    def under_way(self) -> bool:
        """Whether somebody presses now."""
        return self._begun_ns is not None

    def update(self, at_ns: int, force_N: float | None) -> GlovePress | None:
        """The press that ends with this sample."""
        if self._begun_ns is None:
            if force_N is not None and force_N >= BEGIN_N:
                self._begun_ns, self._peak_N, self._unknown = at_ns, force_N, False
            return None
        if force_N is None:
            self._unknown = True
            return None
        self._peak_N = max(self._peak_N, force_N)
        if force_N > END_N:
            return None
        seconds, self._begun_ns = (at_ns - self._begun_ns) * 1e-9, None
        return GlovePress(self._peak_N, seconds, self._trouble(seconds))

    def _trouble(self, seconds: float) -> str:
        if self._unknown:
            return "a finger's force was not known: beyond the heaviest weight of its calibration, or its wire"
        if seconds < LEAST_S:
            return f"too short, {seconds:.2f} s (at least {LEAST_S:g} s): a knock"
        return ""


def judged(presses: Sequence[GlovePress]) -> tuple[GlovePress, ...]:
    """The presses, with that refused which lies too far from the median of those that count."""
    sound = [number for number, press in enumerate(presses) if not press.refused]
    if len(sound) < PRESSES:
        return tuple(presses)
    middle_N = median(presses[number].peak_N for number in sound)
    farthest = max(sound, key=lambda number: abs(presses[number].peak_N - middle_N))
    off = abs(presses[farthest].peak_N - middle_N) / middle_N
    if off <= SPREAD:
        return tuple(presses)
    why = f"{off:.0%} off the median of {middle_N:.1f} N (at most {SPREAD:.0%}): repeated"
    found = GlovePress(presses[farthest].peak_N, presses[farthest].seconds, why)
    return (*presses[:farthest], found, *presses[farthest + 1 :])


def threshold_N(presses: Iterable[GlovePress]) -> float | None:
    """The value, once three presses count; None before."""
    peaks_N = [press.peak_N for press in presses if not press.refused]
    return median(peaks_N) if len(peaks_N) >= PRESSES else None


def gathered(samples: Iterable[tuple[int, float | None]]) -> Iterator[tuple[GlovePress, ...]]:
    """All presses so far, whenever one has ended, until three count or too many were made."""
    finder = PressFinder()
    presses: tuple[GlovePress, ...] = ()
    for at_ns, force_N in samples:
        press = finder.update(at_ns, force_N)
        if press:
            presses = judged((*presses, press))
            yield presses
            if threshold_N(presses) is not None or len(presses) >= MOST:
                return
