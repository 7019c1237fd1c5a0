"""A loop that is played by hand into a real ring, and the real service's streams over it."""

import contextlib
import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import uvicorn
from fastapi import FastAPI
from starlette.requests import HTTPConnection

from api.http import problems
from api.http.access.rights import ENTITLED, READ
from api.http.connection import server_settings
from api.http.streams.events import EventLog
from api.http.streams.feed import Feed
from api.http.streams.routes import build
from api.http.streams.session import Streams
from mock_devices.testing.commands import free_port, until
from rig.channels import (
    AXIS,
    EVENT,
    FORCE,
    LOOP,
    MARKER,
    AxisSample,
    EventSample,
    ForceSample,
    LoopSample,
    MarkerSample,
)
from rig.config.wiring import Wiring
from rig.recording.ring import RingReader, RingWriter

ZERO_N = -0.25
MARKER_EVERY = 16
SESSION = "0" * 32


def force_N(number: int) -> float:
    """From the zero; a slow wave, so that no two neighbours are alike."""
    return 2.0 + math.sin(number / 50)


class PlayedBench:
    """Publishes cycles as the loop does; ``recorder`` reads them, so that the ring never fills."""

    def __init__(self, folder: Path, name: str = "ring", slots: int = 1 << 15) -> None:
        self.ring_path = folder / name
        self._ring = RingWriter.create(self.ring_path, slots)
        self._recorder = RingReader.open(self.ring_path)
        self.start_ns = time.monotonic_ns()
        self.cycles = self.force_seq = self.marker_seq = self.events = 0
        self.peaks: dict[int, float] = {}
        self.silent = False
        """Whether the sensor says nothing while the loop goes on with what it said last."""

    def play(self, count: int, zero_N: float = ZERO_N) -> None:
        """So many cycles of 1 ms each, at once."""
        for _ in range(count):
            self._cycle(zero_N)
        self._recorder.drain(1 << 20)

    def lose_force(self, count: int) -> None:
        """So many readings never come, though they have numbers."""
        self.force_seq += count

    def event(self, code: str, text: str = "") -> None:
        """One event."""
        now_ns = self._now_ns
        self._ring.put(EVENT.id, EVENT.pack(EventSample(self.events, now_ns, now_ns, 10, code, text)))
        self.events += 1

    def close(self) -> None:
        """Ends the loop."""
        self._recorder.close()
        self._ring.close()

    @property
    def _now_ns(self) -> int:
        return self.start_ns + self.cycles * 1_000_000

    def _cycle(self, zero_N: float) -> None:
        now_ns, number = self._now_ns, self.cycles
        if number % MARKER_EVERY == 0:
            for tool in (0, 1):
                place = (math.nan,) * 3 if tool else (number * 0.5, 0.0, 1.0)
                row = MarkerSample(self.marker_seq, now_ns, now_ns, number, tool, *place, 1, 0, 0, 0, 0.1, 1 - tool)
                self._ring.put(MARKER.id, MARKER.pack(row))
                self.marker_seq += 1
        shown_N = self.peaks.get(number, force_N(number))
        raw_N = shown_N + zero_N
        force = ForceSample(self.force_seq, now_ns, now_ns, 0, 0, 0, -raw_N, 0, 0, 0, 25.0, 0, 1)
        if not self.silent:
            self._ring.put(FORCE.id, FORCE.pack(force))
            self.force_seq += 1
        axis = AxisSample(number, now_ns, now_ns, number * 0.001, 1.0, 0.1, 0, 1)
        self._ring.put(AXIS.id, AXIS.pack(axis))
        loop = LoopSample(number, now_ns, now_ns, number, 0, now_ns, 0, 0, 0, 0, 0, 0, 1, 0, raw_N - zero_N, 3.0,
                          number * 0.001, number * 0.001, math.nan, math.nan, math.nan)  # fmt: skip
        self._ring.put(LOOP.id, LOOP.pack(loop))
        self.cycles += 1


class PlayedService:
    """The streams' routes over whichever ``bench`` there is, on ``port``."""

    def __init__(self, events: EventLog | None = None) -> None:
        self.bench: PlayedBench | None = None
        self.events = events or EventLog()
        self.port = free_port()
        self.entitled = True
        """Whether whoever looks on still may."""
        self._server: uvicorn.Server | None = None

    @contextlib.contextmanager
    def served(self) -> Iterator["PlayedService"]:
        """Listens until the block ends."""
        app = self._application()
        settings = server_settings()
        self._server = uvicorn.Server(uvicorn.Config(app, host="127.0.0.1", port=self.port, **settings))
        thread = threading.Thread(target=self._server.run)
        thread.start()
        until(lambda: self._server and self._server.started, 20.0, "the service listening")
        try:
            yield self
        finally:
            self._server.should_exit = True
            thread.join(20)

    def caught_up(self) -> None:
        """Waits until all that was played is in the histories."""
        bench = self.bench
        assert bench
        until(lambda: self.feed.run.histories["loop"].end == bench.cycles, 20.0, "the feed having taken all")

    def _application(self) -> FastAPI:
        wiring = Wiring()

        @contextlib.asynccontextmanager
        async def lifespan(_: FastAPI):  # type: ignore[no-untyped-def]
            import asyncio  # noqa: PLC0415

            following = asyncio.create_task(self.feed.follow())
            yield
            following.cancel()

        app = FastAPI(lifespan=lifespan)
        problems.install(app)
        self.feed = Feed(wiring, lambda: self.bench, self.events)
        app.include_router(build(Streams(wiring, self.feed, SESSION)))
        assert READ.dependency
        app.dependency_overrides[READ.dependency] = self._let_in
        return app

    def _let_in(self, connection: HTTPConnection) -> None:
        """Everybody: who may is tested in tests/api/access."""
        connection.scope[ENTITLED] = lambda: self.entitled
