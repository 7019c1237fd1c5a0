"""What repeats of one motion say of a model: what their errors have in common is misfit, what differs is chance.

Two recordings repeat each other where the tip went the same way at the same time after contact, whatever is written in
their names. No flexible model is needed: a force that comes again is no noise (pure error; Draper and Smith 1998, 2.1).
"""

from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from rig.diagnosis.bootstrap import bootstrap
from rig.diagnosis.estimates import Estimate
from rig.diagnosis.left_out import LeftOut
from rig.diagnosis.noise import Array, Index
from rig.simulation.drive import MeasuredMotion

MATCH_SHARE = 0.02  # of the depth: force there differs by what the model follows to a hundredth and better
LEAST_SHARE = 0.5  # of a cycle in contact; the way in and half a hold make two cycles one experiment
# Noise that lasts a tenth of a cycle leaves ten independent pieces of it.
PIECES = 10
FEWEST_PIECES = 20  # an interval from ten is half as wide as what is asked for


class Repeats(NamedTuple):
    """Error between repeats [N], and what their errors have in common over what they differ by; None if unknown."""

    pure_error_N: float
    shared: Estimate | None


class _Pair(NamedTuple):
    """Rows of two recordings where the tip was at one place at one time after contact, each shape (m,)."""

    one: Index
    other: Index


def compare_repeats(errors: LeftOut, drive: MeasuredMotion, contact_mm: Array) -> Repeats | None:
    """Errors of repeats against each other; None where no motion was repeated."""
    pairs = matched(errors, drive, contact_mm)
    if not pairs:
        return None
    units = np.concatenate([_pieces(errors.residual, rows) for rows in pairs.values()])
    _, differing, count = units.sum(axis=0)
    if not differing > 0:
        return None
    return Repeats(float(np.sqrt(differing / count)), _shared(units) if len(units) >= FEWEST_PIECES else None)


def _pieces(residual: Array, rows: list[_Pair]) -> Array:
    """Sums over a tenth of a motion and all its repeats: product, half the squared difference, rows; shape (10, 3)."""
    found = np.zeros((PIECES, 3))
    for pair in rows:
        one, other = residual[pair.one], residual[pair.other]
        place = np.arange(len(one)) * PIECES // len(one)
        for k, column in enumerate((one * other, 0.5 * (one - other) ** 2, np.ones_like(one))):
            found[:, k] += np.bincount(place, column, PIECES)
    return found


def _shared(units: Array) -> Estimate:
    """Ratio of the first two sums over pieces, shape (pieces, 3)."""
    return bootstrap(units, lambda means: np.asarray(means[0] / np.maximum(means[1], 1e-300)))


def matched(errors: LeftOut, drive: MeasuredMotion, contact_mm: Array) -> dict[int, list[_Pair]]:
    """Pairs of recordings that repeat each other, those of one motion together."""
    depth_mm = drive.position_mm - contact_mm[drive.recording]
    touched = {
        i: since
        for i, (begin, end) in enumerate(pairwise(drive.starts))
        if (since := _since_half(drive.time_s[begin:end], depth_mm[begin:end])) is not None
    }
    motion, found = {i: i for i in touched}, dict[int, list[_Pair]]()
    for i, j in combinations(touched, 2):
        pair = _match(errors, drive, depth_mm, (i, touched[i]), (j, touched[j]))
        if pair is not None:
            motion[j] = min(motion[i], motion[j])
            found.setdefault(motion[j], []).append(pair)
    return found


def _since_half(time_s: Array, depth_mm: Array) -> Array | None:
    """Time since the tip first passed half of its depth, shape (n,); None where it never went in."""
    deepest = float(depth_mm.max())
    if not deepest > 0:
        return None
    at = int(np.argmax(depth_mm > 0.5 * deepest))
    before = max(at - 1, 0)
    passed_s = np.interp(0.5 * deepest, depth_mm[[before, at]], time_s[[before, at]]) if before < at else time_s[at]
    return np.asarray(time_s - passed_s)


def _match(
    errors: LeftOut, drive: MeasuredMotion, depth_mm: Array, first: tuple[int, Array], second: tuple[int, Array]
) -> _Pair | None:
    """Rows of two recordings at one place and time after contact; None where these are less than half of a cycle."""
    (i, since_i), (j, since_j) = first, second
    start_i, start_j = drive.starts[i], drive.starts[j]
    near = np.clip(np.searchsorted(since_j, since_i - 0.5 * drive.period_s), 0, len(since_j) - 1)
    one, other = start_i + np.arange(len(since_i)), start_j + near
    inside = depth_mm[one] > 0
    tolerance = MATCH_SHARE * float(depth_mm[one].max())
    same = inside & (np.abs(depth_mm[one] - depth_mm[other]) < tolerance)
    same &= np.abs(since_i - since_j[near]) <= drive.period_s
    if np.count_nonzero(same) < LEAST_SHARE * np.count_nonzero(inside):
        return None
    rows = same & errors.judged[one] & errors.judged[other]
    return _Pair(one[rows], other[rows]) if np.count_nonzero(rows) >= PIECES else None
