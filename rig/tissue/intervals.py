"""The one level of all intervals, and how far it reaches."""

from scipy.special import stdtrit

LEVEL = 0.95  # the convention, so that intervals compare with published ones


def student_reach(freedom: int) -> float:
    """Standard errors from the middle of an interval at ``LEVEL`` to its end, of Student's t with at least 1 degree."""
    return float(stdtrit(max(freedom, 1), (1 + LEVEL) / 2))
