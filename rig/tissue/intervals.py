"""The one level of all intervals, how far it reaches, and what a law's covariance means to what the law gives."""

from collections.abc import Callable

import numpy as np
from scipy.special import stdtrit

from rig.tissue.laws import FloatArray, Law

STEP = 1e-6  # of a parameter, for slopes: the root of what a double resolves is 1.5e-8
LEVEL = 0.95  # the convention, so that intervals compare with published ones


def student_reach(freedom: int) -> float:
    """Standard errors from the middle of an interval at ``LEVEL`` to its end, of Student's t with at least 1 degree."""
    return float(stdtrit(max(freedom, 1), (1 + LEVEL) / 2))


def carried(law: Law, covariance: FloatArray, given: Callable[[Law], FloatArray]) -> FloatArray:
    """Standard deviations of what ``given`` makes of a law, shape (k, r): its parameters', by the delta method."""
    here, slopes = given(law), []
    for index, parameter in enumerate(law.parameters):
        step = STEP * max(abs(parameter.value), 1e-3)
        step = step if parameter.value + step <= parameter.upper else -step
        values = law.values
        values[index] += step
        slopes.append((given(law.from_values(values)) - here) / step)
    squares = np.einsum("pkr,pq,qkr->kr", np.array(slopes), covariance, np.array(slopes))
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))
