"""Where the tip touches: the onset of force along one loading, as a position with an interval.

Force is modelled as level before the contact c, and after it as a jump (a viscous term acts at once) and shapes of the
depth p - c, none with a negative factor: any tissue that resists and stiffens. Every c is tried with every family of
shapes, with the jump and without; the sums of squares, read as likelihoods with a penalty for each family and for the
jump, give the contact (mean and deviation over all of them) and, with a penalty for the jump or without, the 95 %
interval; without any, what it may be at most (three deviations).

No shapes are tissue's for long. ``find_contact`` takes as much of the loading as these shapes leave noise of, so that
what is deeper does not speak for the surface.

The work comes in portions of one candidate and one family (``ContactSearch.advance``), so that the control loop can do
it between two cycles; ``find_contact`` does it at once.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

FloatArray = NDArray[np.float64]
# Sums of squares without and with a jump, by the contact tried [mm] and the number of its family.
Misfits = dict[tuple[float, int], tuple[float, float]]

CANDIDATES = 61
# In units of the variance: a candidate five deviations off is not looked at closely.
FAR = 30.0
# Of the likelihood ratio (Wilks 1938): 95 % of contact and the form of the onset together, three deviations of contact.
PROBABLE, LARGEST = 5.99, 9.0
# A jump costs two further parameters' worth of evidence (2 ln of the odds, as in Akaike's criterion), a family that
# starts without slope a further e^4 against: soft tissue under a tip a few millimetres wide does not.
JUMP_PENALTY = 4.0
POWERS_PENALTY = 8.0
LEAST_SEARCH_MM = 0.1  # half of what contact is known to in a good trial
# Finer than any converter's step, and above zero: an exact curve has no noise of its own.
LEAST_NOISE_N = 1e-5
CLEAR_SPREADS = 6.0  # of normal noise two samples in a thousand million lie further off
# Of a few millimetres these are hundredths: no contact is known better.
ROWS = 400
# A loading is cut where force is a half, a quarter ... of its end; below 16 deviations too little of its form is left.
CUTS, LEAST_SPREADS = 6, 16.0
# Two samples always lie on a line; the third can contradict it.
LEAST_LOADED = 3
# Force that grows as depth to the power 2.5 is under six deviations for twice the way that it takes from there to 16.
HIDDEN_WAYS = 3.0
# Groups of rows whose means tell a curve that misses the force from noise, and three deviations of their sum.
GROUPS = 10
MOST_MISFIT = GROUPS + 3 * np.sqrt(2 * GROUPS)
# A sphere has 1.5, a cone 2; sums of these stiffen as tissue does, up to x exp(x/2) at ten millimetres.
POWERS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0)
# Of the way: what is forgotten faster is a jump, what is forgotten more slowly does not show.
FORGETTING = (0.125, 0.5)


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
    """Force against axis position on the way in, each of shape (n,); ``samples`` readings were averaged to each row.

    ``apart_mm``: how far a row may lie from where its force was; no contact is known better.
    """

    position_mm: FloatArray
    force_N: FloatArray
    samples: FloatArray
    apart_mm: float = 0.0


class Family(NamedTuple):
    """``shapes(depth_mm)``: forces of shape (m, k), each growing from zero; ``penalty``: 2 ln of the odds against."""

    shapes: Callable[[FloatArray], FloatArray]
    penalty: float


def _onsets(depth_mm: FloatArray) -> FloatArray:
    """Powers of depth, and what relaxation leaves of the first and the second at steady speed."""
    share = depth_mm / max(float(depth_mm.max()), 1e-9)
    root, square = np.sqrt(share), share * share
    cube = square * share
    # As products: a power of each row takes ten times as long.
    columns = [share, share * root, square, square * root, cube, square * square, cube * cube]
    for length in FORGETTING:
        left = length * -np.expm1(-share / length)
        columns += [left, 2 * length * (share - left)]
    return np.array(columns).T


def _powers(depth_mm: FloatArray) -> FloatArray:
    share = depth_mm / max(float(depth_mm.max()), 1e-9)
    return np.column_stack([share**power for power in (1, 2, 3, 4, 6)])


def _stiffening(depth_mm: FloatArray) -> FloatArray:
    """x and x exp(x/2): with positive factors they stand for x exp(b x) with b up to 0.5 per mm."""
    return np.column_stack([depth_mm, depth_mm * np.exp(0.5 * depth_mm)])


# A whole cycle says itself how its force grows.
ANY_SHAPE = (Family(_onsets, 0.0),)
# A touch of a few tenths of a newton does not: limbs stiffen as the study's index law (b of 0.1 to 0.4 per mm).
LIMB_SHAPE = (Family(_stiffening, 0.0), Family(_powers, POWERS_PENALTY))


class ContactSearch:
    """The search within ``search_mm`` for the contact of a ``loading`` that begins in the air; its level is found too.

    ``noise_N`` is the standard deviation of one sample; ``known`` keeps misfits for a further search of the same rows.
    """

    def __init__(
        self,
        loading: Loading,
        search_mm: tuple[float, float],
        noise_N: float,
        families: tuple[Family, ...] = ANY_SHAPE,
        rounds: int = 2,
        known: Misfits | None = None,
    ) -> None:
        self._loading, self._noise_N, self._families = loading, max(noise_N, LEAST_NOISE_N), families
        self._rounds, self._known = rounds, {} if known is None else known
        self._share, self._weight = loading.samples / loading.samples.sum(), np.sqrt(loading.samples)
        self._force = (loading.force_N - self._share @ loading.force_N) * self._weight
        self._candidates = np.linspace(min(search_mm[0], search_mm[1] - LEAST_SEARCH_MM), search_mm[1], CANDIDATES)
        self._misfits = np.empty((CANDIDATES, 2 * len(families)))
        self._done = 0

    def advance(self) -> bool:
        """One candidate with one family, about 0.1 ms; True once the contact is known."""
        if self._rounds == 0:
            return True
        candidate, family = divmod(self._done, len(self._families))
        key = float(self._candidates[candidate]), family
        if key not in self._known:
            self._known[key] = self._misfit(candidate, self._families[family])
        self._misfits[candidate, 2 * family : 2 * family + 2] = self._known[key]
        self._done += 1
        if self._done == CANDIDATES * len(self._families):
            self._rounds, self._done = self._rounds - 1, 0
            if self._rounds:
                self._narrow()
        return self._rounds == 0

    def _misfit(self, candidate: int, family: Family) -> tuple[float, float]:
        """Sums of squares without and with a jump."""
        columns, force = self._centred(candidate, family)
        if not columns.shape[1]:
            return float(force @ force), float(force @ force)
        factors, jumped = nnls(columns, force)
        # A best answer that makes no jump is the best of those that may make none as well.
        level = nnls(columns[:, :-1], force)[1] if factors[-1] else jumped
        return float(level) ** 2, float(jumped) ** 2

    def _centred(self, candidate: int, family: Family) -> tuple[FloatArray, FloatArray]:
        """Weighted columns (m, k) and forces (m,), both less their means, so that the level drops out."""
        depth_mm = self._loading.position_mm - self._candidates[candidate]
        inside = depth_mm >= 0
        columns = np.zeros((len(depth_mm), 0)) if not inside.any() else _inside(depth_mm, inside, family)
        columns -= self._share @ columns
        columns *= self._weight[:, None]
        return columns, self._force

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
        families = np.repeat([family.penalty for family in self._families], 2)
        penalised = excess + families + np.tile([0.0, JUMP_PENALTY], len(self._families))
        weights = np.exp(-(penalised - penalised.min()) / 2).sum(axis=1)
        found_mm = float(np.average(candidates, weights=weights))
        # Without a jump's penalty alone, what the penalty makes likelier could lie outside its own interval.
        probable = candidates[(_within(excess + families) | _within(penalised)).any(axis=1)]
        likely = candidates[(excess <= LARGEST).any(axis=1)]
        step_mm = max(float(candidates[1] - candidates[0]), self._loading.apart_mm)
        spread_mm = np.sqrt(np.average((candidates - found_mm) ** 2, weights=weights))
        return Contact(
            position_mm=found_mm,
            lower_mm=float(likely[0]) - step_mm,
            upper_mm=float(likely[-1]) + step_mm,
            deviation_mm=float(np.hypot(spread_mm, step_mm / 2)),
            low_mm=min(float(probable[0]) - step_mm, found_mm),
            high_mm=max(float(probable[-1]) + step_mm, found_mm),
        )

    @property
    def fits(self) -> bool:
        """Whether the best of the candidates leaves of the loading what is left of the air: noise."""
        candidate, column = np.unravel_index(int(self._misfits.argmin()), self._misfits.shape)
        columns, force = self._centred(int(candidate), self._families[column // 2])
        left, samples = force - columns @ nnls(columns, force)[0], self._loading.samples
        inside = np.flatnonzero(self._loading.position_mm >= self._candidates[candidate])
        if len(inside) <= columns.shape[1]:
            return True
        air = np.delete(left, inside)
        variance = max(float(air @ air) / max(len(air) - 1, 1), self._noise_N**2)
        groups = np.array_split(inside, min(GROUPS, len(inside)))
        sums = [(np.sum(left[group] * np.sqrt(samples[group])), samples[group].sum()) for group in groups]
        return bool(sum(total**2 / count for total, count in sums) <= MOST_MISFIT * variance)


def _within(excess: FloatArray) -> NDArray[np.bool_]:
    """What lies in the 95 % region of its own best."""
    return np.asarray(excess <= PROBABLE + excess.min())


def find_contact(
    position_mm: FloatArray,
    force_N: FloatArray,
    search_mm: tuple[float, float],
    noise_N: float,
    known: dict[tuple[int, int], Misfits] | None = None,
) -> Contact:
    """The contact within ``search_mm``, of which the further end is in it without doubt.

    ``position_mm`` and ``force_N``, shape (n,), are an approach that begins in the air and ends shallow; the force of
    the air has standard deviation ``noise_N``. The interval is that of the longest loading that fits and of its half,
    so that what misses the form and is not seen to do so is in it too. ``known`` keeps misfits by first and last row
    for a further search of the same approach with another zero or noise: neither changes them.
    """
    ends = _ends(position_mm, force_N, search_mm[1], noise_N)
    known = {} if known is None else known
    search = _search(position_mm, force_N, search_mm, noise_N, next(ends), known)
    for end in ends:
        longer, search = search, _search(position_mm, force_N, search_mm, noise_N, end, known)
        if longer.fits:
            return _union(longer.contact, search.contact)
    return search.contact


def _search(
    position_mm: FloatArray,
    force_N: FloatArray,
    search_mm: tuple[float, float],
    noise_N: float,
    end: int,
    known: dict[tuple[int, int], Misfits],
) -> ContactSearch:
    """The search that is through, in the loading up to a sample."""
    first_mm, touch_mm = search_mm
    # The last samples of the air may lie further from the touch than the whole loading is long.
    before_mm = touch_mm - float(position_mm[max(int(np.argmax(position_mm >= touch_mm)) - LEAST_LOADED, 0)])
    way_mm = max(float(position_mm[end - 1]) - touch_mm, LEAST_SEARCH_MM)
    highest_mm = max(first_mm, touch_mm - max(HIDDEN_WAYS * way_mm, before_mm))
    near = np.flatnonzero(position_mm[:end] >= highest_mm - max(way_mm, before_mm))
    misfits = known.setdefault((int(near[0]), end), {})
    rows = rows_of(position_mm[near], force_N[near])
    search = ContactSearch(rows, (highest_mm, touch_mm), noise_N, known=misfits)
    while not search.advance():
        pass
    return search


def _union(found: Contact, other: Contact) -> Contact:
    """``found`` with the intervals of both."""
    lower_mm, upper_mm = min(found.lower_mm, other.lower_mm), max(found.upper_mm, other.upper_mm)
    low_mm, high_mm = min(found.low_mm, other.low_mm), max(found.high_mm, other.high_mm)
    return Contact(found.position_mm, lower_mm, upper_mm, found.deviation_mm, low_mm, high_mm)


def _ends(position_mm: FloatArray, force_N: FloatArray, touch_mm: float, noise_N: float) -> Iterator[int]:
    """The samples by which force first comes to its end, a half of it, a quarter and so on, while that tells a form."""
    touch = int(np.argmax(position_mm >= touch_mm))
    last = len(force_N)
    yield last
    for level_N in float(force_N[touch:].max()) * 0.5 ** np.arange(1, CUTS):
        end = max(touch + int(np.argmax(force_N[touch:] > level_N)) + 1, touch + LEAST_LOADED)
        if level_N < LEAST_SPREADS * noise_N or end >= last:
            return
        last = end
        yield end


def rows_of(position_mm: FloatArray, force_N: FloatArray, most: int = ROWS) -> Loading:
    """Means over at most so many equal steps of position; arrays have shape (n,)."""
    if len(position_mm) <= most:
        return Loading(position_mm, force_N, np.ones(len(position_mm)))
    gone = (position_mm - position_mm.min()) / np.ptp(position_mm)
    row = np.minimum((gone * most).astype(np.intp), most - 1)
    samples = np.bincount(row)
    columns = (np.bincount(row, column)[samples > 0] for column in (position_mm, force_N))
    position_mm, force_N = (column / samples[samples > 0] for column in columns)
    return Loading(position_mm, force_N, samples[samples > 0].astype(float), float(np.ptp(position_mm)) / most)


def _inside(depth_mm: FloatArray, inside: NDArray[np.bool_], family: Family) -> FloatArray:
    """Columns of the family's shapes and of the jump, zero in the air."""
    shapes = family.shapes(depth_mm[inside]).T
    columns = np.zeros((len(shapes) + 1, len(depth_mm)))
    columns[:-1, inside], columns[-1] = shapes, inside
    return columns.T
