"""How many may look on at a time, and how often one of them may say something."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from api.http.access.limits import Rate
from api.http.problems import RequestRefused

# Fifty clients are what the load test serves beside a loop in contact; one credential takes half of all at most, so
# that it shuts nobody else out.
MOST_OPEN, MOST_OPEN_EACH = 128, 64
# A page says a few when a view opens, a program some a second; each takes time of the event loop.
MESSAGES = Rate(100, 20)
RETRY_S = 5


class OpenConnections:
    """Open connections by who has them. Used from the event loop alone."""

    def __init__(self) -> None:
        self._open = Counter[str]()

    @contextmanager
    def joined(self, who: str) -> Iterator[None]:
        """One more for as long as the block lasts; raises RequestRefused where there are as many as may be."""
        if self._open[who] >= MOST_OPEN_EACH:
            raise _full(f"this token or login has {MOST_OPEN_EACH} open connections, the most there may be; close one")
        if self._open.total() >= MOST_OPEN:
            raise _full(f"{MOST_OPEN} connections are open, the most there may be; come back later")
        self._open[who] += 1
        try:
            yield
        finally:
            self._open[who] -= 1
            self._open += Counter[str]()  # without those who have none


def _full(text: str) -> RequestRefused:
    return RequestRefused(429, "too-many-open", text, headers={"Retry-After": str(RETRY_S)})
