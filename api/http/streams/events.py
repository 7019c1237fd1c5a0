"""What happened, numbered and kept, so that whoever was away can be told: none is ever dropped on the way."""

import threading
import time
from collections import deque
from collections.abc import Callable

from pydantic import BaseModel, Field, JsonValue

# A day of a busy bench; a client further behind has stopped reading.
KEPT_EVENTS = 10_000


class LiveEvent(BaseModel):
    """Something that happened once."""

    type: str = "event"
    seq: int = Field(description="number in this service, from 1; none is left out")
    time_ns: int = Field(description="host monotonic time, as of samples")
    source: str = Field(description="bench, or what else it came from: job, control, service")
    level: int = Field(description="10 note, 20 warning, 30 soft stop, 40 immediate stop")
    code: str
    text: str
    data: dict[str, JsonValue] = Field(default_factory=dict, description="what programs may want of it")


class EventsLost(Exception):
    """Whoever asks is further behind than what is kept: ``oldest`` is the first event still there."""

    def __init__(self, oldest: int) -> None:
        super().__init__(f"events before {oldest} are not kept any more")
        self.oldest = oldest


class EventLog:
    """Events in their order. Any thread may publish."""

    def __init__(self, kept: int = KEPT_EVENTS, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._events = deque[LiveEvent](maxlen=kept)
        self._now_ns = now_ns
        self._lock = threading.Lock()
        self.last = 0
        """Number of the newest; 0 where nothing has happened yet."""

    def publish(
        self,
        source: str,
        code: str,
        text: str,
        level: int = 10,
        time_ns: int = 0,
        data: dict[str, JsonValue] | None = None,
    ) -> LiveEvent:
        """Adds one; ``time_ns`` 0: now."""
        with self._lock:
            self.last += 1
            event = LiveEvent(
                seq=self.last, time_ns=time_ns or self._now_ns(), source=source, level=level, code=code, text=text,
                data=data or {},
            )  # fmt: skip
            self._events.append(event)
        return event

    def after(self, seq: int) -> list[LiveEvent]:
        """All after number ``seq``, oldest first; raises EventsLost where some of them are not kept any more."""
        with self._lock:
            oldest = self._events[0].seq if self._events else self.last + 1
            if seq + 1 < oldest:
                raise EventsLost(oldest)
            behind = self.last - seq
            return [self._events[place] for place in range(len(self._events) - behind, len(self._events))]
