"""How an axis answers its set-point, as far as a force law needs to know."""

from typing import NamedTuple


class AxisResponse(NamedTuple):
    """Set-point to force sensed: a pure delay and two first-order lags; ``tip_lag_s`` is from set-point to tip.

    All in s, for the loop's own rate, with the sensor's filter and the computer's reading included in the first three.
    """

    delay_s: float
    lag1_s: float
    lag2_s: float
    tip_lag_s: float

    @property
    def lag_s(self) -> float:
        """How much later than its command the force shows, for slow changes."""
        return self.delay_s + self.lag1_s + self.lag2_s
