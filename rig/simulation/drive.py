"""What drives the simulation: the motion that was measured, at the times the force was."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.tissue.history import History

Array = NDArray[np.float64]
Index = NDArray[np.int64]
# Four deviations of a velocity over 8 ms from places that jitter by 0.4 um; the slowest touch has 0.5 mm/s.
SETTLE_MM_S = 0.3


@dataclass(frozen=True)
class MeasuredMotion:
    """Motion of all recordings of a session, flat, one after another, each on its own uniform grid.

    All arrays have shape (n,) except those of the tip tracker, shape (m,): ``tip_at`` is where on the flat grid a frame
    falls (in samples, fractional) and ``tip_recording`` the recording it belongs to.
    """

    time_s: Array  # session time
    period_s: float
    recording: Index
    position_mm: Array
    velocity_mm_s: Array
    acceleration_mm_s2: Array
    cycle: Array  # number of the indentation in the session, from 0
    temperature_C: Array | None
    tip_at: Array
    tip_recording: Index

    @property
    def size(self) -> int:
        """Samples on the grid."""
        return len(self.time_s)

    @property
    def recordings(self) -> int:
        """Number of recordings."""
        return int(self.recording[-1]) + 1 if self.size else 0

    @cached_property
    def starts(self) -> Index:
        """Index of the first sample of each recording, and the total, shape (recordings + 1,)."""
        edges = np.flatnonzero(np.diff(self.recording)) + 1
        return np.concatenate([[0], edges, [self.size]]).astype(np.int64)

    @cached_property
    def first(self) -> NDArray[np.bool_]:
        """True at the first sample of each recording, shape (n,)."""
        mark = np.zeros(self.size, bool)
        mark[self.starts[:-1]] = True
        return mark

    @cached_property
    def history(self) -> History:
        """Each recording as a path of its own."""
        return History(np.where(self.first, np.inf, np.diff(self.time_s, prepend=self.time_s[:1])))

    @cached_property
    def in_recording_s(self) -> Array:
        """Time since the recording's first sample, shape (n,)."""
        return self.time_s - self.time_s[self.starts[:-1]][self.recording]

    @cached_property
    def since_reversal_s(self) -> Array:
        """Time since the direction of motion last changed (or motion began or ended), shape (n,)."""
        moving = np.sign(np.where(np.abs(self.velocity_mm_s) < SETTLE_MM_S, 0.0, self.velocity_mm_s))
        turn = self.first | (np.diff(moving, prepend=moving[:1]) != 0)
        last = np.maximum.accumulate(np.where(turn, np.arange(self.size), 0))
        return self.time_s - self.time_s[last]

    @cached_property
    def speed_mm_s(self) -> Array:
        """Largest loading speed of the recording each sample belongs to (98th percentile), shape (n,)."""
        pairs = zip(self.starts[:-1], self.starts[1:], strict=True)
        fastest = np.array([np.percentile(np.maximum(self.velocity_mm_s[i:j], 0), 98) for i, j in pairs])
        return fastest[self.recording]

    def rate(self, signal: Array) -> Array:
        """Time derivative by central differences inside each recording, shape (n,)."""
        slope = np.empty_like(signal)
        slope[1:-1] = (signal[2:] - signal[:-2]) / (2 * self.period_s)
        begin, end = self.starts[:-1], self.starts[1:] - 1
        slope[begin] = (signal[np.minimum(begin + 1, end)] - signal[begin]) / self.period_s
        slope[end] = (signal[end] - signal[np.maximum(end - 1, begin)]) / self.period_s
        return slope

    def shifted(self, signal: Array, delay_s: float) -> Array:
        """``signal(t - delay_s)`` by cubic interpolation inside each recording, held at its ends, shape (n,)."""
        delay = delay_s / self.period_s
        whole = int(np.floor(-delay))
        reach = min(max(abs(whole - 1), abs(whole + 2)), self.size)
        padded = np.pad(signal, reach, mode="edge")
        rows = [padded[reach + whole + k : reach + whole + k + self.size] for k in (-1, 0, 1, 2)]
        late = np.asarray(sum(w * row for w, row in zip(_lagrange(-delay - whole), rows, strict=True)))
        ends = np.flatnonzero((self._from_start < reach) | (self._to_end < reach))
        late[ends] = self._gather(signal, np.asarray(ends - delay, float), self.recording[ends])
        return late

    def delayed(self, signal: Array, delay_s: Array) -> Array:
        """``signal`` at each sample's time minus its own delay, as ``shifted``, shape (n,)."""
        return self._gather(signal, np.arange(self.size) - delay_s / self.period_s, self.recording)

    @cached_property
    def _from_start(self) -> Index:
        return np.arange(self.size) - self.starts[:-1][self.recording]

    @cached_property
    def _to_end(self) -> Index:
        return self.starts[1:][self.recording] - 1 - np.arange(self.size)

    def at_tracker(self, signal: Array, delay_s: float = 0.0) -> Array:
        """``signal`` at the tracker's frame times minus ``delay_s``, shape (m,)."""
        if delay_s == 0:
            return _weighted(signal, self._tracker_stencil)
        return self._gather(signal, self.tip_at - delay_s / self.period_s, self.tip_recording)

    @cached_property
    def _tracker_stencil(self) -> tuple[Index, Array]:
        return self._stencil(self.tip_at, self.tip_recording)

    def _gather(self, signal: Array, at: Array, recording: Index) -> Array:
        return _weighted(signal, self._stencil(at, recording))

    def _stencil(self, at: Array, recording: Index) -> tuple[Index, Array]:
        """Four neighbours and their weights, each shape (4, len(at)), for cubic (Lagrange) interpolation.

        Exact for cubics, so a corner of the motion is not low-passed as by linear interpolation.
        """
        low, high = self.starts[:-1][recording], self.starts[1:][recording] - 1
        at = np.minimum(np.maximum(at, low), high)
        base = np.floor(at).astype(np.int64)
        f = at - base
        rows = np.stack([np.minimum(np.maximum(base + k, low), high) for k in (-1, 0, 1, 2)])
        return rows, np.stack(_lagrange(f))


def _lagrange(f: Any) -> tuple[Any, ...]:
    """Weights of the neighbours -1, 0, 1, 2 at the fraction ``f`` between 0 and 1."""
    return (
        -f * (f - 1) * (f - 2) / 6, (f + 1) * (f - 1) * (f - 2) / 2, -(f + 1) * f * (f - 2) / 2,
        (f + 1) * f * (f - 1) / 6,
    )  # fmt: skip


def _weighted(signal: Array, stencil: tuple[Index, Array]) -> Array:
    rows, weights = stencil
    return np.asarray(np.einsum("km,km->m", signal[rows], weights))
