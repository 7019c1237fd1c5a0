"""Health of one stream in three bits: alive (young enough), valid (the device vouches for it), on rate.

A position may stay the same for ever, and be right; what tells a frozen one is a set-point that goes on without it.
"""

import math
from collections import deque
from dataclasses import dataclass, field

NEVER_NS = 1 << 62  # 146 years: older than any sample, and ages from it still have 64 bits
ALIVE, VALID, ON_RATE = 1, 2, 4
IDENTICAL_LIMIT = 100  # with noise of half a step every other sample is alike, but never a hundred in a row
# 10 ms at 1 kHz, in which a trial of 30 mm/s goes the 0.3 mm of `axis.standstill_mm`: neither waits for the other.
STANDING_REPORTS = 10
SET_OUT_MM = 0.01  # before that no report counts: an axis at rest names one place, and may do so late
SENT_KEPT = 2048  # 1 s at 2 kHz, the longest that an axis may be told to be silent for (`loop.stale_axis_ms`)
# Neighbouring rates of a sensor lie 20 % apart; jitter of 40 % of a period moves a mean of fifty by 4 %.
RATE_TOLERANCE = 0.2


@dataclass(slots=True)
class StreamHealth:
    """Watches one stream; ``update`` is called once a sample, the rest once a cycle."""

    period_ns: int
    stale_ns: int
    identical_limit: int = IDENTICAL_LIMIT
    valid: bool = False
    identical: int = 0
    _last_capture_ns: int = -NEVER_NS
    _mean_period_ns: float = 0.0
    _last_value: object = None

    def update(self, capture_ns: int, valid: bool, value: object = None) -> None:
        """Takes note of one sample; ``value`` is what must not stay the same for ever, None where anything may."""
        if self._last_capture_ns > -NEVER_NS:
            self._mean_period_ns += 0.02 * (capture_ns - self._last_capture_ns - self._mean_period_ns)
        else:
            self._mean_period_ns = self.period_ns
        self._last_capture_ns, self.valid = capture_ns, valid
        self.identical = self.identical + 1 if value is not None and value == self._last_value else 0
        self._last_value = value

    def age_ns(self, now_ns: int) -> int:
        """Since the newest sample was taken; a huge number before the first."""
        return now_ns - self._last_capture_ns

    def alive(self, now_ns: int) -> bool:
        """Whether the newest sample still counts."""
        return self.age_ns(now_ns) < self.stale_ns

    @property
    def frozen(self) -> bool:
        """The same value too often in a row for a converter with noise."""
        return self.identical > self.identical_limit

    @property
    def rate_Hz(self) -> float:
        """Mean rate of the last fifty samples or so."""
        return 1e9 / self._mean_period_ns if self._mean_period_ns > 0 else 0.0

    def bits(self, now_ns: int) -> int:
        """The three bits."""
        on_rate = abs(self._mean_period_ns - self.period_ns) < RATE_TOLERANCE * self.period_ns
        return ALIVE * self.alive(now_ns) | VALID * self.valid | ON_RATE * on_rate


@dataclass(slots=True)
class Standstill:
    """How far a set-point went while the axis named one and the same place; ``update`` is called once a report.

    A report is held against the set-point in force when it was asked for: one that comes late says where the axis was.
    """

    _sent: deque[tuple[int, float]] = field(default_factory=lambda: deque(maxlen=SENT_KEPT))
    _position_mm: float = math.nan
    _setpoint_mm: float = math.nan
    _reports: int = 0

    def sent(self, now_ns: int, setpoint_mm: float) -> None:
        """A set-point goes out, and a report is asked for."""
        self._sent.append((now_ns, setpoint_mm))

    def update(self, capture_ns: int, position_mm: float) -> float:
        """Way of the set-point since the place last changed [mm]; 0 until the tenth report after it set out."""
        if not self._sent:
            return 0.0
        while len(self._sent) > 1 and self._sent[1][0] <= capture_ns:
            self._sent.popleft()
        setpoint_mm = self._sent[0][1]
        if position_mm != self._position_mm:
            self._position_mm, self._setpoint_mm = position_mm, setpoint_mm
        gone_mm = abs(setpoint_mm - self._setpoint_mm)
        self._reports = self._reports + 1 if gone_mm > SET_OUT_MM else 1
        return gone_mm if self._reports > STANDING_REPORTS else 0.0

    def begin(self) -> None:
        """What came before counts no more: a new program sets out from where the axis is."""
        self._position_mm = math.nan
