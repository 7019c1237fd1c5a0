"""What an approach leaves behind: force paired with the position it was taken at, and the surface found from that."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from rig.trials.contact import Loading

# 1,024 rows a hundredth of a millimetre apart are the last ten millimetres, and 0.15 ms a portion of the estimator.
ROWS, ROW_MM = 1024, 0.01
# Samples of force wait for the axis sample after them, or come long after it: 64 of force are more than a device has
# under way, and 256 of the axis reach back a quarter of a second, ten times the slower sensor's latency.
WAITING, AXIS_SAMPLES = 64, 256


class PairedSamples:
    """Force against the axis position at the force's capture time, averaged over hundredths of a millimetre; bounded.

    Both streams are fed in the order of their capture; nothing is kept unless ``collecting``.
    """

    def __init__(self) -> None:
        self.collecting = False
        self._waiting: deque[tuple[int, float]] = deque(maxlen=WAITING)
        self._axis: deque[tuple[int, float]] = deque(maxlen=AXIS_SAMPLES)
        self._rows: deque[list[float]] = deque(maxlen=ROWS)
        self.samples = 0

    def clear(self) -> None:
        """Forgets all but where the axis was."""
        self._waiting.clear()
        self._rows.clear()
        self.samples = 0

    def force(self, capture_ns: int, force_N: float) -> None:
        """One sample of force, which may come long after the axis' of the same time."""
        if self.collecting and math.isfinite(force_N):
            self._waiting.append((capture_ns, force_N))
            self._pair()

    def axis(self, capture_ns: int, position_mm: float) -> None:
        """One sample of the axis: all force taken before it has its position now."""
        if not self._axis or capture_ns > self._axis[-1][0]:
            self._axis.append((capture_ns, position_mm))
            self._pair()

    def _pair(self) -> None:
        while self._waiting and self._axis and self._waiting[0][0] <= self._axis[-1][0]:
            taken_ns, force_N = self._waiting.popleft()
            position_mm = self._position_mm(taken_ns)
            if position_mm is not None:
                self._add(position_mm, force_N)

    def _position_mm(self, taken_ns: int) -> float | None:
        """The axis at a time up to its newest sample; None before the oldest that is kept."""
        after_ns, after_mm = self._axis[-1]
        for before_ns, before_mm in reversed(self._axis):
            if before_ns <= taken_ns:
                share = (taken_ns - before_ns) / max(after_ns - before_ns, 1)
                return before_mm + share * (after_mm - before_mm)
            after_ns, after_mm = before_ns, before_mm
        return None

    def _add(self, position_mm: float, force_N: float) -> None:
        self.samples += 1
        last = self._rows[-1] if self._rows else None
        if last and abs(position_mm - last[3]) < ROW_MM:
            last[0] += 1
            last[1] += position_mm
            last[2] += force_N
        else:
            self._rows.append([1, position_mm, force_N, position_mm])

    @property
    def loading(self) -> Loading:
        """All rows, in the order they were taken."""
        rows = np.array(self._rows, dtype=np.float64).reshape(-1, 4)
        return Loading(rows[:, 1] / rows[:, 0], rows[:, 2] / rows[:, 0], rows[:, 0])


@dataclass(frozen=True)
class Touch:
    """The surface found in an approach, its 95 % interval, and what it was found from."""

    surface_mm: float
    low_mm: float
    high_mm: float
    detected_mm: float
    detected_N: float
    samples: int
    touches: int

    @property
    def within_mm(self) -> float:
        """How far the interval reaches from the surface, at most."""
        return max(self.high_mm - self.surface_mm, self.surface_mm - self.low_mm)

    @property
    def sentence(self) -> str:
        """What was used, for a person."""
        slow = f", {self.touches} slow touches" if self.touches else ""
        return (
            f"surface {self.surface_mm:.3f} mm (95 %: {self.low_mm:.3f} to {self.high_mm:.3f}) back from "
            f"{self.detected_N:.2f} N at {self.detected_mm:.2f} mm, {self.samples} samples{slow}"
        )
