"""Where the surface lies of a loading that begins pressed, or at the surface: before its start, by how force grows on.

The tissue was pressed to the start and held, so that its force there has relaxed, by half at most; what comes after
does so too, or not yet. So the onset's shapes are tried as they are, with half of the force at the start, and with half
of all force forgotten; at rest the force is known. They say what the interval is where they leave nothing but noise of
the loading; where they do not, and at most, a bound stands that needs no more than that force grows no faster than
depth squared.
"""

from collections.abc import Iterator

import numpy as np

from rig.trials.contact import (
    CLEAR_SPREADS,
    FORGETTING,
    LEAST_SPREADS,
    POWERS,
    Contact,
    ContactSearch,
    Family,
    FloatArray,
    Loading,
    rows_of,
)

# Force under a sphere grows as depth to the power 1.5, under a cone as its square; limbs stiffen no faster at first.
STEEPEST_POWER = 2.0
# Of the force at a preload that has been held: meat and elastomer keep half of it and more for minutes.
LEAST_LEFT = 0.5
# Nearer to the preload, transients of the start decide; further on, how the tissue stiffens does.
FORCE_FOLD = 3.0
# A drive has its speed within a hundredth of its way.
MOVING_SHARE = 0.005
# Of the growth of force: deeper force says more of the tissue than of its surface, but for a large preload.
SHALLOW_SHARE, PRELOADS = 0.15, 4.0
CUTS = 5
# A curve of fifth degree takes up what a smooth loading is; of a hundred rows it leaves their noise.
ROWS, DEGREE = 100, 5
# Three rows a parameter of contact, jump and level.
LEAST_ROWS = 9
# Of a zero that is known without doubt, as if so many samples had been taken of it.
MOST_SAMPLES = 1e6


def contact_before(position_mm: FloatArray, force_N: FloatArray, start: tuple[float, float], noise_N: float) -> Contact:
    """The contact of a loading, arrays of shape (n,), that begins in contact or at the surface.

    ``start`` is the force at rest before it, zero taken off, and its standard deviation; ``noise_N`` that of a sample.
    Where force tells nothing the interval is as long as the loading.
    """
    bounds_mm = _bounds(position_mm, force_N, start, noise_N)
    moves = _moves(position_mm)
    longer: ContactSearch | None = None
    for end in _ends(force_N, start[0], noise_N, moves):
        search = _search(position_mm[moves:end], force_N[moves:end], start[1], noise_N, bounds_mm)
        if longer and longer.fits:
            return _between(bounds_mm, min(longer.contact.low_mm, search.contact.low_mm))
        longer = search
    return _between(bounds_mm, bounds_mm[0])


def _between(bounds_mm: tuple[float, float], low_mm: float) -> Contact:
    low_mm, high_mm = max(low_mm, bounds_mm[0]), bounds_mm[1]
    return Contact((low_mm + high_mm) / 2, bounds_mm[0], high_mm, (high_mm - low_mm) / 4, low_mm, high_mm)


def _bounds(
    position_mm: FloatArray, force_N: FloatArray, start: tuple[float, float], noise_N: float
) -> tuple[float, float]:
    """Force that grows by three times that at the start, once the tip moves, tells by the way it takes how far it is.

    That is for force that grows no faster than depth squared, from a preload that keeps half of its force.
    """
    start_N, deviation_N = start
    largest_N = max(start_N, 0.0) + 2 * deviation_N
    way_mm = position_mm - position_mm[0]
    growth_N = max(FORCE_FOLD * largest_N, CLEAR_SPREADS * noise_N)
    # What friction and viscosity add as the tip sets off is not the tissue's elastic force.
    moving_N = max(float(force_N[_moves(position_mm)]), largest_N)
    reached = np.flatnonzero(force_N > moving_N + growth_N + CLEAR_SPREADS / 2 * noise_N)
    grown = (1 + LEAST_LEFT * growth_N / largest_N) ** (1 / STEEPEST_POWER)
    before_mm = float(way_mm[reached[0]] / (grown - 1) if len(reached) else way_mm.max())
    clear = np.flatnonzero(force_N > start_N + CLEAR_SPREADS * noise_N)
    # No contact is known better than the samples lie apart.
    apart_mm = float(np.median(np.abs(np.diff(position_mm))))
    touched = start_N > 2 * deviation_N or not len(clear)
    return float(position_mm[0]) - before_mm - apart_mm, float(position_mm[0 if touched else clear[0]]) + apart_mm


def _moves(position_mm: FloatArray) -> int:
    """The first sample at which the drive has its speed."""
    way_mm = position_mm - position_mm[0]
    return min(max(int(np.argmax(way_mm > MOVING_SHARE * way_mm.max())), 1), len(way_mm) - 1)


def _ends(force_N: FloatArray, start_N: float, noise_N: float, moves: int) -> Iterator[int]:
    """The samples by which force has first grown by its largest level, a half of it, a quarter and so on."""
    growth_N, last = force_N - start_N, len(force_N) + 1
    largest_N = max(SHALLOW_SHARE * float(growth_N.max()), PRELOADS * start_N)
    for level_N in largest_N * 0.5 ** np.arange(CUTS):
        end = int(np.argmax(growth_N > level_N)) + 1 if growth_N.max() > level_N else len(force_N)
        if end - moves < LEAST_ROWS or level_N < LEAST_SPREADS * noise_N:
            return
        if end < last:
            yield end
        last = end


def _search(
    position_mm: FloatArray, force_N: FloatArray, zero_N: float, noise_N: float, search_mm: tuple[float, float]
) -> ContactSearch:
    """The search that is through; zero, known to ``zero_N``, is a row of as many samples above all that is searched."""
    loading = rows_of(position_mm, force_N, ROWS)
    noise_N = max(noise_N, _rough_N(loading))
    samples = min((noise_N / zero_N) ** 2, MOST_SAMPLES) if zero_N > 0 else MOST_SAMPLES
    above_mm = search_mm[0] - float(np.ptp(position_mm))
    rows = zip((above_mm, 0.0, samples), loading[:3], strict=True)
    position_mm, force_N, counts = (np.concatenate([[one], rest]) for one, rest in rows)
    search = ContactSearch(Loading(position_mm, force_N, counts, loading.apart_mm), search_mm, noise_N, PRESSED)
    while not search.advance():
        pass
    return search


def _rough_N(loading: Loading) -> float:
    """What a smooth curve leaves of a loading, as the standard deviation of one sample; 0 of too few rows."""
    freedom = len(loading.force_N) - DEGREE - 1
    if freedom <= DEGREE:
        return 0.0
    weight = np.sqrt(loading.samples)
    smooth = np.polynomial.Polynomial.fit(loading.position_mm, loading.force_N, DEGREE, w=weight)
    left = (loading.force_N - smooth(loading.position_mm)) * weight
    return float(np.sqrt(left @ left / freedom))


def _pressed(depth_mm: FloatArray) -> FloatArray:
    """Powers of depth, whole, with half of the first one's force, and with half of all force forgotten on the way."""
    share = depth_mm / max(float(depth_mm.max()), 1e-9)
    first, forgotten = float(share.min()), 1 - LEAST_LEFT
    way, columns = share - first, []
    for power in POWERS:
        columns += [share**power, share**power - forgotten * first**power]
    for length in FORGETTING:
        left = length * -np.expm1(-way / length)
        left_squared = 2 * first * left + 2 * length * (way - left)
        columns += [LEAST_LEFT * share + forgotten * left, LEAST_LEFT * share**2 + forgotten * left_squared]
    return np.column_stack(columns)


PRESSED = (Family(_pressed, 0.0),)
