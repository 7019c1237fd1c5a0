"""From single runs to numbers with intervals: over subjects, each the mean of its seeds."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from benchmarks.control.cases import BANDS, FORCES_N
from benchmarks.control.laws import CONSTANTS, LAW
from rig.config.table import Table

BEST = "best constant of each test"
BANDED = ("", *(f" {band}" for band in BANDS))


class Score(NamedTuple):
    """One run: which law, case and subject, and its number."""

    law: str
    case: str
    subject: str
    seed: int
    value: float


class Mean(Table):
    """A mean over subjects with half of its 95 % interval, and the worst of them."""

    value: float
    within: float
    worst: float


class Gain(Table):
    """The other over the law: geometric mean over subjects, its 95 % interval, and the ratio of both worst subjects."""

    value: float
    low: float
    high: float
    of_worst: float


def by_subject(scores: Iterable[Score], law: str, cases: Sequence[str]) -> dict[str, float]:
    """Of each subject the mean over seeds of the largest of ``cases``."""
    runs: dict[tuple[str, int], float] = {}
    for score in scores:
        if score.law == law and score.case in cases:
            key = score.subject, score.seed
            runs[key] = max(runs.get(key, 0.0), score.value)
    subjects = sorted({subject for subject, _ in runs})
    return {one: float(np.mean([value for (subject, _), value in runs.items() if subject == one])) for one in subjects}


def mean_of(scores: Sequence[Score], law: str, cases: Sequence[str]) -> Mean:
    """Over subjects, by Student's t."""
    values = np.array(list(by_subject(scores, law, cases).values()))
    return Mean(value=float(values.mean()), within=_half(values), worst=float(values.max()))


def gain_of(scores: Sequence[Score], other: str, cases: Sequence[str], law: str = LAW) -> Gain:
    """How many times smaller the law's number is than the alternative's."""
    ours, theirs = by_subject(scores, law, cases), by_subject(scores, other, cases)
    logs = np.log([theirs[subject] / ours[subject] for subject in ours])
    middle, half = float(logs.mean()), _half(logs)
    worst = max(theirs.values()) / max(ours.values())
    return Gain(value=math.exp(middle), low=math.exp(middle - half), high=math.exp(middle + half), of_worst=worst)


def _half(values: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> float:
    count = len(values)
    if count < 2:
        return 0.0
    return float(student.ppf(0.975, count - 1) * values.std(ddof=1) / math.sqrt(count))


def wrong_models(what: str) -> list[str]:
    """Names of the jumps with half, right and twice the stiffness, and of the slowest of these."""
    return [what, *(f"{what}, x{stiffness}" for stiffness in ("0.5", "1", "2"))]


class Headline(Table):
    """What the benchmark promises, against the best constant per subject; the last line of its output.

    ``contact_peak`` is the law's peak over that of whichever constant has the smaller one, the largest of all subjects
    and speeds of the limb. ``contact_peak_of_asked`` is the worst subject's over the force asked for, by that speed.
    ``settling_gains`` are of low jumps and jumps by the band, the first against the constant as above, the second
    against whichever constant settles first.
    """

    limb_2Hz_gain: Mapping[str, float]
    low_jump_settling_gain: float
    jump_settling_gain: float
    contact_peak: float
    margins_deg_dB: tuple[float, float]
    contact_peak_of_asked: Mapping[str, float]
    settling_gains: Mapping[str, tuple[float, float]]


def limb_gains(scores: Sequence[Score], other: str) -> dict[str, Gain]:
    """By force, where the limb moves at 2 Hz."""
    return {f"{force_N:g}": gain_of(scores, other, [f"limb 2 Hz, {force_N:g} N"]) for force_N in FORCES_N}


def headline(scores: Sequence[Score], margins_deg_dB: tuple[float, float]) -> Headline:
    """The constant is the one that is tuned best for a limb that moves, and the same in all tests but contact."""
    constant = next(iter(CONSTANTS))
    best = [*scores, *best_constant(scores)]
    contacts = list(dict.fromkeys(score.case for score in scores if score.case.startswith("contact")))
    settled = {
        what: (
            round(gain_of(best, constant, wrong_models(what)).value, 2),
            round(gain_of(best, BEST, wrong_models(what)).value, 2),
        )
        for what in (f"{jumps}{band}" for jumps in ("low jumps", "jumps") for band in BANDED)
    }
    return Headline(
        limb_2Hz_gain={force_N: round(gain.value, 2) for force_N, gain in limb_gains(scores, constant).items()},
        low_jump_settling_gain=settled["low jumps"][0],
        jump_settling_gain=settled["jumps"][0],
        contact_peak=round(max(_largest_ratio(best, case) for case in contacts), 3),
        margins_deg_dB=(round(margins_deg_dB[0], 1), round(margins_deg_dB[1], 1)),
        contact_peak_of_asked={case: round(mean_of(scores, LAW, [case]).worst, 3) for case in contacts},
        settling_gains=settled,
    )


def best_constant(scores: Sequence[Score]) -> list[Score]:
    """Of each case, subject and seed whichever constant is best there; no single law is as good as that.

    Of jumps it is the constant whose slowest jump of all models is the fastest.
    """
    runs = [score for score in scores if score.law in CONSTANTS]
    worst: dict[tuple[str, str, str, int], float] = {}
    for one in runs:
        key = one.law, one.case.partition(",")[0] if "jumps" in one.case else one.case, one.subject, one.seed
        worst[key] = max(worst.get(key, 0.0), one.value)
    found: dict[tuple[str, str, int], float] = {}
    for (_, case, subject, seed), value in worst.items():
        found[case, subject, seed] = min(found.get((case, subject, seed), math.inf), value)
    return [Score(BEST, case, subject, seed, value) for (case, subject, seed), value in found.items()]


def _largest_ratio(scores: Sequence[Score], case: str) -> float:
    """The law's number over the best constant's, the largest over subjects."""
    ours, theirs = by_subject(scores, LAW, [case]), by_subject(scores, BEST, [case])
    return max(ours[subject] / theirs[subject] for subject in ours)
