"""What an approach leaves behind: force paired with the position it was taken at, and the surface found from that."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from rig.trials.contact import Loading

# 1,024 rows a hundredth of a millimetre apart are the last ten millimetres, and 0.15 ms a portion of the estimator.
ROWS, ROW_MM = 1024, 0.01
# Samples wait for the axis sample after them: 64 are more than either device has under way.
WAITING = 64


class PairedSamples:
    """Force against the axis position at the force's capture time, averaged over hundredths of a millimetre; bounded.

    Both streams are fed in the order of their capture; nothing is kept unless ``collecting``.
    """

    def __init__(self) -> None:
        self.collecting = False
        self._waiting: deque[tuple[int, float]] = deque(maxlen=WAITING)
        self._rows: deque[list[float]] = deque(maxlen=ROWS)
        self._axis: tuple[int, float] | None = None
        self.samples = 0

    def clear(self) -> None:
        """Forgets all."""
        self._waiting.clear()
        self._rows.clear()
        self.samples = 0

    def force(self, capture_ns: int, force_N: float) -> None:
        """One sample of force."""
        if self.collecting and math.isfinite(force_N):
            self._waiting.append((capture_ns, force_N))

    def axis(self, capture_ns: int, position_mm: float) -> None:
        """One sample of the axis: all force taken before it has its position now."""
        before, self._axis = self._axis, (capture_ns, position_mm)
        if before is None or capture_ns <= before[0]:
            return
        while self._waiting and self._waiting[0][0] <= capture_ns:
            taken_ns, force_N = self._waiting.popleft()
            if taken_ns >= before[0] and self.collecting:
                share = (taken_ns - before[0]) / (capture_ns - before[0])
                self._add(before[1] + share * (position_mm - before[1]), force_N)

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
