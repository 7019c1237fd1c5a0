"""From the loop's ring to histories and events, twenty-five times a second, whether or not anybody looks."""

import asyncio
import contextlib
import itertools
import time
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from api.http.streams.events import EventLog
from api.http.streams.live_run import LiveRun
from rig.channels import EVENT, LOOP
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.recording.slots import Slots, texts_of
from rig.recording.tap import RingTap

PERIOD_S = 0.04
# Followers are woken one part after another over the period: no stop waits while fifty of them are served.
PARTS = 10
# Of the parts so many are woken in one period: fewer where the event loop comes late, so that all who look on together
# leave time for whoever stops. They get as much, in larger pieces and up to five periods later.
SERVED = (10, 5, 2)
LATE_S, CALM_PERIODS = 0.005, 25
# Two seconds of the bench, which take a few milliseconds.
MOST_SLOTS = 8192
# A loop that has published nothing for this many turns, 0.2 s, is not within a cycle: it has ended.
PATIENT_TURNS = 5


class RunningBench(Protocol):
    """A running bench."""

    @property
    def ring_path(self) -> Path:
        """Where its loop publishes."""


class Feed:
    """Follows whichever bench there is. All of it happens in the thread of the event loop."""

    def __init__(
        self,
        wiring: Wiring,
        bench: Callable[[], RunningBench | None],
        events: EventLog,
        onlookers: Sequence[Callable[[Slots], None]] = (),
    ) -> None:
        """``onlookers`` are called with all that was published, as it lies in the ring."""
        self._wiring, self._bench, self.events, self._onlookers = wiring, bench, events, onlookers
        self._followed: RunningBench | None = None
        self._tap: RingTap | None = None
        self._fruitless = 0
        self._turns, self._places = [asyncio.Event() for _ in range(PARTS)], itertools.cycle(range(PARTS))
        self._due, self._slower, self._calm = itertools.cycle(range(PARTS)), 0, 0
        self.now_ns = time.monotonic_ns()
        """When the newest turn began: all clients see the same moment."""
        self.run = LiveRun(wiring)

    async def follow(self) -> None:
        """Goes on until it is cancelled."""
        try:
            while True:
                self._try_step()
                self._pace(await self._serve(SERVED[self._slower]))
        finally:
            self._let_go()

    async def _serve(self, parts: int) -> float:
        """Wakes so many parts one after another within a period; by how much the latest turn came late, in s."""
        began_s, late_s = time.monotonic(), 0.0
        for number in range(1, parts + 1):
            place, due_s = next(self._due), began_s + number * PERIOD_S / parts
            turn, self._turns[place] = self._turns[place], asyncio.Event()
            turn.set()
            await asyncio.sleep(due_s - time.monotonic())
            late_s = max(late_s, time.monotonic() - due_s)
        return late_s

    def _pace(self, late_s: float) -> None:
        """Serves fewer parts a period from the next on where turns come late, and more again after a calm second."""
        self._calm = self._calm + 1 if late_s <= LATE_S else 0
        if not self._calm:
            self._slower = min(self._slower + 1, len(SERVED) - 1)
        elif self._calm % CALM_PERIODS == 0:
            self._slower = max(self._slower - 1, 0)

    def follower(self) -> Callable[[], Awaitable[None]]:
        """Waits until there may be something new, once a period while there is time for all; each has its place."""
        place = next(self._places)

        async def turn() -> None:
            await self._turns[place].wait()

        return turn

    @property
    def missed(self) -> int:
        """Samples of this run for which the service came too late."""
        return self._tap.missed if self._tap else 0

    def _try_step(self) -> None:
        try:
            self.step()
        except Exception as error:  # nothing stands above this task: what goes wrong is told, and this run given up
            self._tap, self.run.ended = None, True
            text = f"live samples end: {type(error).__name__}: {error}; connect the bench again, and report this"
            self.events.publish("service", "feed_failed", text, 20)

    def step(self) -> None:
        """Takes what has been published since the last time."""
        self.now_ns = time.monotonic_ns()
        bench = self._bench()
        if bench is not self._followed:
            self._let_go()
            self._followed = bench
            if bench is not None:
                self._begin(bench.ring_path)
        if self._tap:
            self._take(self._tap)

    def _begin(self, ring: Path) -> None:
        with contextlib.suppress(UsageError):  # a loop that has ended already
            self._tap = RingTap.open(ring)
            self.run.ended, self.run = True, LiveRun(self._wiring)

    def _let_go(self) -> None:
        if self._tap:
            self._fruitless = PATIENT_TURNS
            while self._take(self._tap):
                pass
            self._tap.close()
        self._tap = None
        self.run.ended = True

    def _take(self, tap: RingTap) -> int:
        """How much there was; a cycle that is still being published is left for the next time."""
        slots = tap.take(MOST_SLOTS)
        cycles = np.flatnonzero(slots["stream"] == LOOP.id)
        whole = int(cycles[-1]) + 1 if len(cycles) else 0
        self._fruitless = 0 if whole else self._fruitless + 1
        if self._fruitless <= PATIENT_TURNS:
            tap.put_back(len(slots) - whole)
            slots = slots[:whole]
        if len(slots):
            self._hand_on(slots)
        return len(slots)

    def _hand_on(self, slots: Slots) -> None:
        self.run.add(slots)
        for _, capture_ns, _, level, code, text in texts_of(slots, EVENT):
            self.events.publish("bench", code, text, level, capture_ns)
        for onlooker in self._onlookers:
            onlooker(slots)
