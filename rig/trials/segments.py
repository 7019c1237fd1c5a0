"""What the tip does, piece by piece: air, loading, hold and unloading; from motion and surface, without force."""

from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from rig.recording.converter import Array, resolution
from rig.trials.streams import in_order, sample_noise

Kind = Literal["air", "loading", "hold", "unloading"]
# Of normal noise two samples in a thousand million lie further off; and of exact places, a ten-thousandth of the way.
STILL_SPREADS, STILL_SHARE = 6.0, 1e-4
# Rounding to fewer steps than these over a way is no encoder's, but a motion that steps.
COARSE_STEPS = 64
# Two steps of an encoder pass in a slow motion while nothing seems to move in between: standing is half of that.
STILL_SPEED = 0.25
# Of the way, the tenth that takes the longest: an approach or a second speed is not what a rest is told from.
SLOWEST_SHARE = 0.9
TURN_S = 0.05  # a drive of 30 mm/s and 2000 mm/s2 turns round in 0.03 s
FEWEST_AT_REST = 3  # two samples of one place are met in any coarse stream
# Rests on one way, from which on the motion steps, and their share of its time: a relaxation is waited for longer.
FEWEST_RESTS, REST_SHARE = 4, 0.1
MARKS = 41


class Segment(NamedTuple):
    """Rows of a cycle, one after another, in which the tip does one thing; ``rows`` has both ends."""

    kind: Kind
    rows: slice

    def took_s(self, time_s: Array) -> float:
        """From its first sample to its last one."""
        return float(time_s[self.rows.stop - 1] - time_s[self.rows.start])


def segments_of(time_s: Array, position_mm: Array, surface_mm: float) -> tuple[Segment, ...]:
    """The segments of a cycle, in order, every row in one of them; times grow, position grows into the tissue.

    Above the surface all is air. In the tissue the tip loads, unloads, or holds where it stands for longer than a drive
    needs to turn. Short rests on one way, four and more, are those of a motion that steps and belong to it. Of a
    recording that tells no surface give the place where it starts, or -inf.
    """
    if len(time_s) < 2:
        return ()
    pieces = list(_stepping(_pieces(time_s, position_mm, surface_mm), time_s))
    return tuple(_merged(part for piece in pieces for part in _in_the_air(piece, position_mm, surface_mm)))


def rows_in(segments: Sequence[Segment], kind: Kind, time_s: Array, after_s: float = 0.0) -> NDArray[np.bool_]:
    """Which rows are of a kind, later than ``after_s`` from where it began; shape (n,)."""
    found = np.zeros(len(time_s), bool)
    for segment in segments:
        if segment.kind == kind:
            found[segment.rows] = time_s[segment.rows] - time_s[segment.rows.start] >= after_s
    return found


def times_by_way(time_s: Array, position_mm: Array) -> tuple[float, Array]:
    """A fortieth of the way in [mm], and how long each of them took [s], shape (40,)."""
    reached_mm = np.maximum.accumulate(position_mm)
    first = in_order(position_mm)
    marks_mm = np.linspace(reached_mm[0], reached_mm[-1], MARKS)
    return float(np.diff(marks_mm)[0]), np.diff(np.interp(marks_mm, reached_mm[first], time_s[first]))


def _pieces(time_s: Array, position_mm: Array, surface_mm: float) -> list[Segment]:
    """Where the tip stands, goes in and comes out, air or not; on an even clock, as the data's may stumble."""
    even_s = np.linspace(time_s[0], time_s[-1], len(time_s))
    even_mm = np.interp(even_s, time_s, position_mm)
    still_mm = _still_mm(position_mm)
    rest_s = max(TURN_S, still_mm / (STILL_SPEED * _slowest(time_s, position_mm, surface_mm)))
    half = max(FEWEST_AT_REST // 2, int(np.ceil(rest_s / float(even_s[1] - even_s[0]) / 2)))
    row = np.rint(np.interp(time_s, even_s, np.arange(len(even_s)))).astype(np.intp)
    doing = np.where(_still(even_mm, half, still_mm), 0, _sense(even_mm, half))[row]
    edges = [0, *(np.flatnonzero(np.diff(doing)) + 1).tolist(), len(doing)]
    kinds: dict[int, Kind] = {0: "hold", 1: "loading", -1: "unloading"}
    return [Segment(kinds[int(doing[start])], slice(start, stop)) for start, stop in pairwise(edges)]


def _still_mm(position_mm: Array) -> float:
    """How far apart the places of a tip at rest may seem to be: by noise, rounding, or nothing of either."""
    travel_mm, step_mm = float(np.ptp(position_mm)), resolution(position_mm)
    # Noise of less than a step turns it over to either side.
    rounding_mm = 2 * step_mm if COARSE_STEPS * step_mm < travel_mm else 0.0
    return max(STILL_SPREADS * sample_noise(position_mm), rounding_mm, STILL_SHARE * travel_mm)


def _slowest(time_s: Array, position_mm: Array, surface_mm: float) -> float:
    """The speed [mm/s] of the slower of the ways in and out of the tissue where it is slow; inf where nothing moves."""
    deepest = int(np.argmax(position_mm))
    ways = (time_s[: deepest + 1], position_mm[: deepest + 1]), (-time_s[deepest:][::-1], position_mm[deepest:][::-1])
    return min((_slow(*way, max(surface_mm, float(position_mm.min()))) for way in ways), default=np.inf)


def _slow(time_s: Array, position_mm: Array, surface_mm: float) -> float:
    above = np.flatnonzero(position_mm <= surface_mm)
    first = int(above[-1]) if len(above) else 0
    inside_s, inside_mm = time_s[first:], position_mm[first:]
    if len(inside_mm) < FEWEST_AT_REST or inside_mm[-1] <= inside_mm[0]:
        return np.inf
    way_mm, took_s = times_by_way(inside_s, inside_mm)
    return way_mm / float(np.quantile(took_s, SLOWEST_SHARE))


def _still(even_mm: Array, half: int, still_mm: float) -> NDArray[np.bool_]:
    """Rows in a stretch of ``2 half + 1`` that goes nowhere."""
    size = 2 * half + 1
    still = maximum_filter1d(even_mm, size) - minimum_filter1d(even_mm, size) <= still_mm
    still[:half] = still[len(still) - half :] = False
    # A step may be over within a sample, and leave none between the rests before and after it.
    return np.asarray(maximum_filter1d(still, size) & (np.abs(np.diff(even_mm, prepend=even_mm[:1])) <= still_mm))


def _sense(even_mm: Array, half: int) -> NDArray[np.int64]:
    """1 on the way in, -1 on the way out; where neither, as before."""
    rows = np.arange(len(even_mm))
    way_mm = even_mm[np.minimum(rows + half, rows[-1])] - even_mm[np.maximum(rows - half, 0)]
    last = np.maximum.accumulate(np.where(way_mm != 0, rows, 0))
    return np.where(way_mm[last] < 0, -1, 1)


def _stepping(pieces: Sequence[Segment], time_s: Array) -> Iterator[Segment]:
    """With the short rests of a motion that steps as part of its way."""
    start, kinds = 0, [piece.kind for piece in pieces]
    while start < len(pieces):
        kind, stop = kinds[start], start + 1
        while kind != "hold" and kinds[stop : stop + 2] == ["hold", kind]:
            stop += 2
        whole = Segment(kind, slice(pieces[start].rows.start, pieces[stop - 1].rows.stop))
        longest_s = REST_SHARE * whole.took_s(time_s)
        short = [piece.took_s(time_s) < longest_s for piece in pieces[start + 1 : stop : 2]]
        steps = sum(short) >= FEWEST_RESTS
        for piece in pieces[start:stop]:
            rests = steps and piece.kind == "hold" and piece.took_s(time_s) < longest_s
            yield Segment(kind, piece.rows) if rests else piece
        start = stop


def _in_the_air(piece: Segment, position_mm: Array, surface_mm: float) -> Iterator[Segment]:
    """The piece parted where it goes through the surface; what rests is whole on one side of it."""
    kind, (start, stop) = piece.kind, (piece.rows.start, piece.rows.stop)
    above = position_mm[piece.rows] < surface_mm
    if kind == "hold":
        yield Segment("air" if np.median(position_mm[piece.rows]) < surface_mm else kind, piece.rows)
        return
    count = int(np.count_nonzero(above))
    cut = start + count if kind == "loading" else stop - count
    kinds: tuple[Kind, Kind] = ("air", kind) if kind == "loading" else (kind, "air")
    parts = zip(kinds, ((start, cut), (cut, stop)), strict=True)
    yield from (Segment(own, slice(first, end)) for own, (first, end) in parts if first < end)


def _merged(parts: Iterator[Segment]) -> Iterator[Segment]:
    for kind, alike in groupby(parts, key=lambda part: part.kind):
        rows = [part.rows for part in alike]
        yield Segment(kind, slice(rows[0].start, rows[-1].stop))
