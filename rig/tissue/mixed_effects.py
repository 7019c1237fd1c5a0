"""One number of several sessions of several subjects: what subjects share, and how they and their sessions differ.

y_ij = mean + subject_i + session_ij, both random and normal, by restricted maximum likelihood (Patterson and Thompson
1971). With as many sessions of each subject that is the one-way analysis of variance, unless sessions of one subject
differ more than subjects do: then subjects are said not to differ.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import chi2, t

from rig.errors import DataError
from rig.tissue.intervals import LEVEL
from rig.tissue.laws import FloatArray

Interval = tuple[float, float]
FEWEST_SUBJECTS = 2  # of one subject nothing is known of others
# Of the variance between subjects over that of their sessions: beyond it the data hold no difference of sessions.
LARGEST_RATIO = 1e9
_SMALLEST_LOG = -20.0  # e^-20: subjects then differ by a billionth of what sessions do, which no data can tell from 0


@dataclass(frozen=True)
class Population:
    """``between`` and ``within`` are standard deviations of subjects and of one subject's sessions.

    ``within`` is None where nobody came twice: ``between`` then holds both. Intervals are those of `LEVEL`, that of
    ``between`` from the profile of the likelihood, that of ``mean`` with a degree of freedom less than subjects.
    """

    subjects: int
    sessions: int
    mean: float
    mean_interval: Interval
    between: float
    between_interval: Interval
    within: float | None


@dataclass(frozen=True)
class _Groups:
    """Sessions, mean and scatter of each subject."""

    counts: FloatArray
    means: FloatArray
    scatter: float

    def weights(self, ratio: float) -> FloatArray:
        return np.asarray(self.counts / (1.0 + ratio * self.counts))

    def mean(self, ratio: float) -> float:
        return float(np.average(self.means, weights=self.weights(ratio)))

    def session_variance(self, ratio: float) -> float:
        """The most likely one for a given ratio."""
        spread = self.weights(ratio) @ (self.means - self.mean(ratio)) ** 2
        return float((self.scatter + spread) / (self.counts.sum() - 1.0))

    def deviance(self, ratio: float) -> float:
        """Minus twice the restricted log likelihood, but for a constant."""
        spread = (self.counts.sum() - 1.0) * math.log(self.session_variance(ratio))
        return float(spread + np.log1p(ratio * self.counts).sum() + math.log(self.weights(ratio).sum()))


def population(values: Mapping[str, Sequence[float]]) -> Population:
    """Of the values of each subject's sessions; raises DataError where they are too few or no numbers."""
    groups = [np.asarray(found, float) for found in values.values() if len(found)]
    if len(groups) < FEWEST_SUBJECTS:
        raise DataError(f"{len(groups)} subject: what subjects share needs at least {FEWEST_SUBJECTS}")
    if not all(np.isfinite(found).all() for found in groups):
        raise DataError("a value is not a number; leave its session out")
    counts = np.array([len(found) for found in groups], float)
    means = np.array([found.mean() for found in groups])
    scatter = float(sum(((found - found.mean()) ** 2).sum() for found in groups))
    if counts.max() == 1.0:
        return _each_once(means)
    if scatter == 0.0:
        return replace(_each_once(means), sessions=int(counts.sum()), within=0.0)
    return _several(_Groups(counts, means, scatter))


def _each_once(means: FloatArray) -> Population:
    """Mean and standard deviation as every textbook has them."""
    free, sd = len(means) - 1, float(means.std(ddof=1))
    low, high = (1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0
    half = float(t.ppf(high, free)) * sd / math.sqrt(len(means))
    mean = float(means.mean())
    spread = sd * math.sqrt(free / chi2.ppf(high, free)), sd * math.sqrt(free / chi2.ppf(low, free))
    return Population(len(means), len(means), mean, (mean - half, mean + half), sd, spread, None)


def _several(groups: _Groups) -> Population:
    ratio = _most_likely(groups)
    variance, mean = groups.session_variance(ratio), groups.mean(ratio)
    error = math.sqrt(variance / groups.weights(ratio).sum())
    half = float(t.ppf((1.0 + LEVEL) / 2.0, len(groups.counts) - 1)) * error
    return Population(
        subjects=len(groups.counts),
        sessions=int(groups.counts.sum()),
        mean=mean,
        mean_interval=(mean - half, mean + half),
        between=math.sqrt(ratio * variance),
        between_interval=_between_interval(groups, ratio),
        within=math.sqrt(variance),
    )


def _most_likely(groups: _Groups) -> float:
    """Ratio of the variances; 0 where subjects differ by no more than their sessions do."""
    bounds = (_SMALLEST_LOG, math.log(LARGEST_RATIO))
    found = minimize_scalar(lambda log: groups.deviance(math.exp(log)), bounds=bounds, options={"xatol": 1e-10})
    ratio = math.exp(found.x)
    return ratio if groups.deviance(ratio) < groups.deviance(0.0) else 0.0


def _between_interval(groups: _Groups, ratio: float) -> Interval:
    """Standard deviations that the likelihood does not rule out."""
    limit = groups.deviance(ratio) + float(chi2.ppf(LEVEL, 1))

    def beyond(log: float) -> float:
        return groups.deviance(math.exp(log)) - limit

    peak, top = math.log(max(ratio, math.exp(_SMALLEST_LOG))), math.log(LARGEST_RATIO)
    low = math.exp(brentq(beyond, _SMALLEST_LOG, peak)) if beyond(_SMALLEST_LOG) > 0.0 > beyond(peak) else 0.0
    high = math.exp(brentq(beyond, peak, top)) if beyond(top) > 0.0 else LARGEST_RATIO
    return math.sqrt(low * groups.session_variance(low)), math.sqrt(high * groups.session_variance(high))
