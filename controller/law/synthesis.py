"""From an axis' response to the three numbers of the force law: a search under stated margins.

The law divides by the tissue it is told of, so that the loop is the axis' own: what is left to choose are crossover,
lead and the second integral's corner. Each lead is tried with each share of the corner in the crossover, and of every
pair the fastest loop taken that keeps MARGIN_DEG and MARGIN_GAIN with SPARE_S more delay on every tissue of the span.
The best of them resists a moving limb best: error is in proportion to 1 / (crossover x corner).
"""

import math
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from controller.law.force_position import LINE_CYCLES
from controller.law.loop_response import (
    Column,
    Constants,
    Margins,
    Rates,
    TrueTissue,
    grid,
    margins,
    noise_share,
    open_loop,
)
from rig.config.axis_response import AxisResponse
from rig.errors import UsageError

# The usual figures of robust design; what textbooks ask for begins at 30 degrees and a factor of 1.7.
MARGIN_DEG, MARGIN_GAIN = 45.0, 2.0
# A cycle of the loop that comes late, or a sample that waits for one.
SPARE_S = 0.001
# Half and twice what the model says: stiffness between two sites of one forearm, or between a muscle at rest and tense.
LEAST_STIFFNESS, LARGEST_STIFFNESS = 0.5, 2.0
# More of the sensor's noise in the tissue's force than this share of one sample's is heard and felt as a tremor.
NOISE_SHARE = 0.5
# Above 3/8 dry friction of the axis and the second integral keep a stiff limb from coming to rest (tests).
SHARES = 0.2, 0.3, 0.375
LEAD_STEPS, SEARCH_STEPS, SEARCH_POINTS = 12, 10, 80
SLOWEST_RAD_S, FASTEST_RAD_S = 2 * math.pi * 0.1, 2 * math.pi * 100.0
# A loop that crosses below 0.5 Hz follows no breathing (0.25 Hz, and its harmonics): it is a constant with a drift.
LEAST_CROSSOVER_RAD_S = 2 * math.pi * 0.5


class Span(NamedTuple):
    """The tissue that a law is made for: k / B of the law and true B over the law's at some depths, and how far off.

    ``stiffness`` and ``damping`` are the least and the largest of true over model.
    """

    corners_rad_s: tuple[float, ...]
    damping_shares: tuple[float, ...]
    stiffness: tuple[float, float] = (LEAST_STIFFNESS, LARGEST_STIFFNESS)
    damping: tuple[float, float] = (1.0, 1.0)


def tissues(span: Span) -> TrueTissue:
    """Every depth with every stiffness and damping at the span's ends, and as the model says."""
    depths = np.arange(len(span.corners_rad_s))
    at, stiffness, damping = np.meshgrid(depths, np.unique([*span.stiffness, 1.0]), np.unique([*span.damping, 1.0]))
    corners, shares = np.asarray(span.corners_rad_s), np.asarray(span.damping_shares)
    return TrueTissue(corners[at.ravel()], stiffness.ravel(), (damping * shares[at]).ravel())


def as_modelled(span: Span) -> TrueTissue:
    """Every depth as the model says."""
    shares = np.asarray(span.damping_shares)
    return TrueTissue(np.asarray(span.corners_rad_s), np.ones_like(shares), shares)


def over_span(axis: AxisResponse, rates: Rates, law: Constants, span: Span, points: int = 1000) -> Margins:
    """Margins on each of the span's tissues, without spare delay."""
    omega = grid(rates, points)
    return margins(open_loop(axis, rates, law, tissues(span), omega), omega)


@lru_cache
def constants(axis: AxisResponse, rates: Rates, span: Span) -> Constants:
    """The law's numbers for this axis and tissue; raises UsageError where no law keeps the margins."""
    _refuse_late(axis, rates)
    leads_s = leads(axis, rates)
    best = Constants(SLOWEST_RAD_S, 0.0, 0.0)
    # From the middle, where the best mostly is: no search where not even what would be as good as the best so far keeps
    # the margins, which is one look instead of ten.
    for lead_s, share in product(sorted(leads_s.tolist(), key=lambda s: abs(s - leads_s.mean())), reversed(SHARES)):
        as_good_rad_s = max(math.sqrt(resistance(best) / share), SLOWEST_RAD_S)
        if _keeps(axis, rates, span, Constants(as_good_rad_s, lead_s, share * as_good_rad_s)):
            best = max(best, _fastest(axis, rates, span, lead_s, share), key=resistance)
    if best.crossover_rad_s < LEAST_CROSSOVER_RAD_S:
        best_Hz, least_Hz = best.crossover_rad_s / (2 * math.pi), LEAST_CROSSOVER_RAD_S / (2 * math.pi)
        raise UsageError(
            f"no force law keeps {MARGIN_DEG:g} deg and a factor of {MARGIN_GAIN:g} on tissue"
            f" {span.stiffness[0]:.2g} to {span.stiffness[1]:.2g} times as stiff as the model, with damping"
            f" {span.damping[0]:.2g} to {span.damping[1]:.2g} times, above {best_Hz:.2g} Hz"
            f" (bound {least_Hz:g} Hz): fit more trials, or shorten the axis' delay"
        )
    return best


def leads(axis: AxisResponse, rates: Rates) -> Column:
    """Leads that are tried [s]: up to half as much again as the lags."""
    return np.linspace(0.0, 1.5 * max(axis.lag1_s + axis.lag2_s, rates.sample_s), LEAD_STEPS)


def resistance(law: Constants) -> float:
    """One over the error that a moving limb leaves, but for what is the same of all laws."""
    return law.crossover_rad_s * law.drift_rad_s


def _refuse_late(axis: AxisResponse, rates: Rates) -> None:
    longest_s = (LINE_CYCLES - 2) * rates.cycle_s
    if axis.delay_s > longest_s:
        raise UsageError(
            f"the axis answers {1000 * axis.delay_s:.3g} ms late, above the {1000 * longest_s:.3g} ms that a force law"
            " can hold: shorten the sensor's and the drive's delay"
        )


def _fastest(axis: AxisResponse, rates: Rates, span: Span, lead_s: float, share: float) -> Constants:
    """The fastest loop with this lead and share that keeps the margins; the slowest where none does."""
    low, high = SLOWEST_RAD_S, FASTEST_RAD_S
    for _ in range(SEARCH_STEPS):
        middle = math.sqrt(low * high)
        keeps = _keeps(axis, rates, span, Constants(middle, lead_s, share * middle))
        low, high = (middle, high) if keeps else (low, middle)
    return Constants(low, lead_s, share * low)


def _keeps(axis: AxisResponse, rates: Rates, span: Span, law: Constants) -> bool:
    """Whether the margins hold with delay to spare, and the noise stays below its share."""
    spared, omega = axis._replace(delay_s=axis.delay_s + SPARE_S), grid(rates, SEARCH_POINTS)
    found = margins(open_loop(spared, rates, law, tissues(span), omega), omega)
    if not (np.all(found.phase_deg >= MARGIN_DEG) and np.all(found.gain >= MARGIN_GAIN)):
        return False
    quiet = noise_share(open_loop(axis, rates, law, as_modelled(span), omega), omega, rates)
    return bool(np.all(quiet <= NOISE_SHARE))


def tolerated(axis: AxisResponse, rates: Rates, law: Constants, span: Span) -> Column:
    """How many times as stiff as the model the tissue may be at each of the span's depths before the loop oscillates.

    Its damping counts as the model says: an environment that is stiff without damping is the worse one.
    """
    omega, stable = grid(rates, 400), np.ones(len(span.corners_rad_s))
    factors = np.geomspace(1.0, 100.0, 60)
    for at, (corner, share) in enumerate(zip(span.corners_rad_s, span.damping_shares, strict=True)):
        tissue = TrueTissue(np.full_like(factors, corner), factors, np.full_like(factors, share))
        kept = margins(open_loop(axis, rates, law, tissue, omega), omega).phase_deg > 0
        stable[at] = factors[-1] if kept.all() else factors[max(int(np.argmin(kept)) - 1, 0)]
    return stable
