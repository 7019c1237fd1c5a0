"""From time stamps of a sender to times of this computer: pure, told what the library said."""

import math
from typing import NamedTuple

from drivers.lsl.library import ClockCorrection
from drivers.roles import LinkCounters

UNKNOWN_NS = -1
# The library holds samples back for the six minutes of its buffer at most; what is older or of tomorrow was stamped by
# another clock than its own, the time of day above all.
OTHER_CLOCK_NS = 400_000_000_000


class Stamps(NamedTuple):
    """Of one sample, as its stream has them."""

    capture_ns: int
    device_ns: int
    correction_ns: int
    uncertainty_ns: int


class SenderClock:
    """The clock of one sender. ``host_ns`` is the host's monotonic time when the library's own clock is zero."""

    def __init__(self, counters: LinkCounters, host_ns: int) -> None:
        self._counters, self._host_ns = counters, host_ns
        self._offset_ns, self._uncertainty_ns = 0, UNKNOWN_NS
        self._last_s, self._last_ns = -math.inf, -(1 << 62)
        self.foreign = 0

    def correct(self, known: ClockCorrection) -> None:
        """What the library says of the offset from now on."""
        self._offset_ns, self._uncertainty_ns = round(known.offset_s * 1e9), math.ceil(known.uncertainty_s * 1e9)

    def stamps(self, stamp_s: float, arrival_ns: int) -> Stamps | None:
        """Times of the sample stamped ``stamp_s``; None for one that came before, which is counted."""
        if not math.isfinite(stamp_s) or stamp_s <= 0:
            return self._without(0, arrival_ns)
        if stamp_s <= self._last_s:
            self._counters.repeated += 1
            return None
        self._last_s = stamp_s
        device_ns = round(stamp_s * 1e9)
        capture_ns = device_ns + self._offset_ns + self._host_ns
        if abs(arrival_ns - capture_ns) > OTHER_CLOCK_NS or self._uncertainty_ns == UNKNOWN_NS:
            return self._without(device_ns, arrival_ns)
        # A new correction may set the clock back by its uncertainty; time goes on all the same.
        self._last_ns = capture_ns = max(min(capture_ns, arrival_ns), self._last_ns + 1)
        return Stamps(capture_ns, device_ns, capture_ns - device_ns, self._uncertainty_ns)

    def _without(self, device_ns: int, arrival_ns: int) -> Stamps:
        """No clock that is known: the sample was taken at an unknown time before it came."""
        self.foreign += 1
        self._last_ns = arrival_ns = max(arrival_ns, self._last_ns + 1)
        return Stamps(arrival_ns, device_ns, arrival_ns - device_ns if device_ns else 0, UNKNOWN_NS)
