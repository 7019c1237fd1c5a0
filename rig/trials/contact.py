"""Where the tip touches: the onset of force along one loading, as a position with an interval.

Force is modelled as level before the contact c, and after it as a jump (a viscous term acts at once) and shapes of the
depth p - c, none with a negative factor: any tissue that resists and stiffens. Every c is tried with every family of
shapes, with the jump and without; the sums of squares, read as likelihoods with a penalty for each family and for the
jump, give the contact (mean, deviation and 95 % interval over all of them) and, without the penalties, what it may be
at most (three deviations).

The work comes in portions of one candidate and one family (``ContactSearch.advance``), so that the control loop can do
it between two cycles; ``find_contact`` does it at once.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

FloatArray = NDArray[np.float64]

CANDIDATES = 61
# In units of the variance: a candidate five deviations off is not looked at closely.
FAR = 30.0
# A jump costs two further parameters' worth of evidence (2 ln of the odds, as in Akaike's criterion), a family that
# starts without slope a further e^4 against: soft tissue under a tip a few millimetres wide does not.
JUMP_PENALTY = 4.0
POWERS_PENALTY = 8.0
LEAST_SEARCH_MM = 0.1  # half of what contact is known to in a good trial
# Finer than any converter's step, and above zero: an exact curve has no noise of its own.
LEAST_NOISE_N = 1e-5
PROBABLE = 0.025, 0.975
# Force under a sphere grows as depth to the power 1.5, under a cone as its square; limbs stiffen no faster at first.
STEEPEST_POWER = 2.0
# Of the force at a preload that has been held: meat and elastomer keep half of it and more for minutes.
LEAST_LEFT = 0.5
# Nearer to the preload, transients of the start decide; further on, how the tissue stiffens does.
FORCE_FOLD = 3.0
# A drive has its speed within a hundredth of its way.
MOVING_SHARE = 0.005
CLEAR_SPREADS = 6.0  # of normal noise two samples in a thousand million lie further off


class Contact(NamedTuple):
    """Axis position of the surface, the interval it must lie in, and its standard deviation (0: unknown).

    ``low_mm`` and ``high_mm`` are the 95 % interval, NaN where only the outer one is known.
    """

    position_mm: float
    lower_mm: float
    upper_mm: float
    deviation_mm: float = 0.0
    low_mm: float = float("nan")
    high_mm: float = float("nan")

    @property
    def likely_mm(self) -> float:
        """The standard deviation; where it is unknown, a sixth of the interval."""
        return self.deviation_mm or (self.upper_mm - self.lower_mm) / 6

    @property
    def within_mm(self) -> float:
        """How far the 95 % interval reaches from the position, at most."""
        return max(self.high_mm - self.position_mm, self.position_mm - self.low_mm)


class Loading(NamedTuple):
    """Force against axis position on the way in, each of shape (n,); ``samples`` readings were averaged to each row."""

    position_mm: FloatArray
    force_N: FloatArray
    samples: FloatArray


class Family(NamedTuple):
    """``shapes(depth_mm)``: forces of shape (m, k), each growing from zero; ``penalty``: 2 ln of the odds against."""

    shapes: Callable[[FloatArray], FloatArray]
    penalty: float


def _powers(depth_mm: FloatArray) -> FloatArray:
    share = depth_mm / max(float(depth_mm.max()), 1e-9)
    return np.column_stack([share**power for power in (1, 2, 3, 4, 6)])


def _stiffening(depth_mm: FloatArray) -> FloatArray:
    """x and x exp(x/2): with positive factors they stand for x exp(b x) with b up to 0.5 per mm."""
    return np.column_stack([depth_mm, depth_mm * np.exp(0.5 * depth_mm)])


# A whole cycle says itself how its force grows.
ANY_SHAPE = (Family(_powers, 0.0),)
# A touch of a few tenths of a newton does not: limbs stiffen as the study's index law (b of 0.1 to 0.4 per mm).
LIMB_SHAPE = (Family(_stiffening, 0.0), Family(_powers, POWERS_PENALTY))


class ContactSearch:
    """The search within ``search_mm`` for the contact of a ``loading`` that begins in the air.

    ``noise_N`` is the standard deviation of one sample. Where ``levelled`` the force in the air is zero; otherwise its
    level is found too.
    """

    def __init__(
        self,
        loading: Loading,
        search_mm: tuple[float, float],
        noise_N: float,
        families: tuple[Family, ...] = ANY_SHAPE,
        levelled: bool = True,
        rounds: int = 2,
    ) -> None:
        self._loading, self._noise_N, self._families = loading, max(noise_N, LEAST_NOISE_N), families
        self._levelled, self._rounds = levelled, rounds
        self._candidates = np.linspace(min(search_mm[0], search_mm[1] - LEAST_SEARCH_MM), search_mm[1], CANDIDATES)
        self._misfits = np.empty((CANDIDATES, 2 * len(families)))
        self._done = 0

    def advance(self) -> bool:
        """One candidate with one family, about 0.1 ms; True once the contact is known."""
        if self._rounds == 0:
            return True
        candidate, family = divmod(self._done, len(self._families))
        self._misfits[candidate, 2 * family : 2 * family + 2] = self._misfit(candidate, self._families[family])
        self._done += 1
        if self._done == CANDIDATES * len(self._families):
            self._rounds, self._done = self._rounds - 1, 0
            if self._rounds:
                self._narrow()
        return self._rounds == 0

    def _misfit(self, candidate: int, family: Family) -> tuple[float, float]:
        """Sums of squares without and with a jump."""
        position_mm, force_N, samples = self._loading
        depth_mm = position_mm - self._candidates[candidate]
        inside = depth_mm >= 0
        if self._levelled:
            return _misfits(depth_mm[inside], force_N[inside], float(np.sum(force_N[~inside] ** 2)), family)
        weight = np.sqrt(samples)
        columns = np.zeros((len(depth_mm), 0)) if not inside.any() else _inside(depth_mm, inside, family)
        force = (force_N - np.average(force_N, weights=samples)) * weight
        if not columns.shape[1]:
            return float(force @ force), float(force @ force)
        columns = (columns - np.average(columns, axis=0, weights=samples)) * weight[:, None]
        return float(nnls(columns[:, :-1], force)[1]) ** 2, float(nnls(columns, force)[1]) ** 2

    def _excess(self) -> FloatArray:
        """Sums of squares over their smallest, in units of the variance, shape (candidates, 2 families)."""
        misfits = self._misfits
        freedom = max(len(self._loading.force_N) - 7, 1)
        variance = max(float(misfits.min()) / freedom, self._noise_N**2)
        return np.asarray((misfits - misfits.min()) / variance)

    def _narrow(self) -> None:
        near = self._candidates[(self._excess() <= FAR).any(axis=1)]
        step_mm = float(self._candidates[1] - self._candidates[0])
        self._candidates = np.linspace(near[0] - step_mm, near[-1] + step_mm, CANDIDATES)

    @property
    def contact(self) -> Contact:
        """What was found; to be read once ``advance`` said that it is."""
        candidates, excess = self._candidates, self._excess()
        penalties = [family.penalty + jump for family in self._families for jump in (0.0, JUMP_PENALTY)]
        penalised = excess + np.array(penalties)
        weights = np.exp(-(penalised - penalised.min()) / 2).sum(axis=1)
        found_mm = float(np.average(candidates, weights=weights))
        likely = candidates[(excess <= 9).any(axis=1)]
        # No contact is known better than the samples lie apart.
        apart_mm = float(np.median(np.abs(np.diff(self._loading.position_mm))))
        step_mm = max(float(candidates[1] - candidates[0]), apart_mm)
        spread_mm = np.sqrt(np.average((candidates - found_mm) ** 2, weights=weights))
        share = (np.cumsum(weights) - weights / 2) / weights.sum()
        low_mm, high_mm = np.interp(PROBABLE, share, candidates)
        return Contact(
            position_mm=found_mm,
            lower_mm=float(likely[0]) - step_mm,
            upper_mm=float(likely[-1]) + step_mm,
            deviation_mm=float(np.hypot(spread_mm, step_mm / 2)),
            low_mm=float(low_mm) - step_mm,
            high_mm=float(high_mm) + step_mm,
        )


def find_contact(
    position_mm: FloatArray, force_N: FloatArray, search_mm: tuple[float, float], noise_N: float
) -> Contact:
    """The contact within ``search_mm``.

    ``position_mm`` and ``force_N``, shape (n,), are a cycle that begins in the air and ends shallow; force is zero in
    the air with standard deviation ``noise_N``.
    """
    search = ContactSearch(Loading(position_mm, force_N, np.ones(len(force_N))), search_mm, noise_N)
    while not search.advance():
        pass
    return search.contact


def contact_before(
    position_mm: FloatArray, force_N: FloatArray, start: tuple[float, float], noise_N: float
) -> Contact | None:
    """The contact of a loading, arrays of shape (n,), that begins in contact or at the surface.

    ``start`` is the force at rest before it, zero taken off, and its standard deviation. Force that grows no faster
    than depth squared, from a preload that keeps half of its force, tells by the way it takes to grow by three times
    that force, once the tip moves, how far before the start contact lies at most. None where it does not grow so far.
    """
    start_N, deviation_N = start
    largest_N = max(start_N, 0.0) + 2 * deviation_N
    way_mm = position_mm - position_mm[0]
    # What friction and viscosity add as the tip sets off is not the tissue's elastic force.
    moves = min(max(int(np.argmax(way_mm > MOVING_SHARE * way_mm.max())), 1), len(force_N) - 1)
    growth_N = max(FORCE_FOLD * largest_N, CLEAR_SPREADS * noise_N)
    reached = np.flatnonzero(force_N > max(force_N[moves], largest_N) + growth_N + CLEAR_SPREADS / 2 * noise_N)
    if not len(reached):
        return None
    grown = (1 + LEAST_LEFT * growth_N / largest_N) ** (1 / STEEPEST_POWER)
    clear = np.flatnonzero(force_N > start_N + CLEAR_SPREADS * noise_N)
    # No contact is known better than the samples lie apart.
    apart_mm = float(np.median(np.abs(np.diff(position_mm))))
    lower_mm = float(position_mm[0] - way_mm[reached[0]] / (grown - 1)) - apart_mm
    upper_mm = float(position_mm[0 if start_N > 2 * deviation_N else clear[0]]) + apart_mm
    middle_mm, width_mm = (lower_mm + upper_mm) / 2, upper_mm - lower_mm
    return Contact(middle_mm, lower_mm, upper_mm, width_mm / 4, lower_mm, upper_mm)


def _inside(depth_mm: FloatArray, inside: NDArray[np.bool_], family: Family) -> FloatArray:
    """Columns of the family's shapes and of the jump, zero in the air."""
    shapes = family.shapes(depth_mm[inside])
    columns = np.zeros((len(depth_mm), shapes.shape[1] + 1))
    columns[inside, :-1], columns[inside, -1] = shapes, 1.0
    return columns


def _misfits(depth_mm: FloatArray, force_N: FloatArray, air: float, family: Family) -> tuple[float, float]:
    if not len(depth_mm):
        return air, air
    columns = np.column_stack([family.shapes(depth_mm), np.ones(len(depth_mm))])
    return air + float(nnls(columns[:, :-1], force_N)[1]) ** 2, air + float(nnls(columns, force_N)[1]) ** 2
