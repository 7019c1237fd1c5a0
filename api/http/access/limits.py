"""How often one caller may ask: a bucket that fills steadily, for each caller and kind of request. Stops pass by it."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from api.http.access.secrets import awake_s


class Rate(NamedTuple):
    """So many at once, and so many a second in the long run."""

    burst: float
    per_s: float


# A page asks a few times a second; a script of 50 clients with one token asks 200 times, and is served.
KNOWN = Rate(1000, 500)
# Without a credential there is a page to load, and a log-in.
UNKNOWN = Rate(60, 20)
# Passwords by hand: five wrong ones, then one in twelve seconds.
PASSWORD = Rate(5, 1 / 12)
# Callers remembered at a time; of more, the one that asked longest ago is forgotten.
CALLERS = 1000


@dataclass
class Bucket:
    """What one caller has left, as of a moment."""

    left: float
    at_s: float


class RateLimits:
    """One bucket a caller. Used from the event loop alone."""

    def __init__(self, now_s: Callable[[], float] = awake_s) -> None:
        self._now_s = now_s
        self._buckets: OrderedDict[tuple[str, Rate], Bucket] = OrderedDict()

    def wait_s(self, who: str, rate: Rate) -> float:
        """Takes one from the bucket of ``who``: 0, or how long to wait where there is none [s]."""
        now_s = self._now_s()
        bucket = self._buckets.setdefault((who, rate), Bucket(rate.burst, now_s))
        self._buckets.move_to_end((who, rate))
        if len(self._buckets) > CALLERS:
            self._buckets.popitem(last=False)
        bucket.left = min(bucket.left + (now_s - bucket.at_s) * rate.per_s, rate.burst)
        bucket.at_s = now_s
        if bucket.left < 1:
            return (1 - bucket.left) / rate.per_s
        bucket.left -= 1
        return 0.0
