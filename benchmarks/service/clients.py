"""The load: `python -m benchmarks.service.clients PORT` until its input ends; a JSON object for each line that it gets.

50 WebSockets of `rig.v1`, most of them as a page subscribes, every tenth with every sample of two streams, and 200
requests a second over sixteen connections. All of it at low priority, in one process that is no part of the
service. What counts is what came: answers of 200, and samples that batches stand for. Lost are those that gaps name,
those that the numbers of batches leave out without a word, and at least one with each client that is thrown out.
"""

import asyncio
import contextlib
import json
import os
import re
import struct
import sys
import time
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import asdict, dataclass, field
from typing import NamedTuple

import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

# Sixteen connections carry 200 requests a second where an answer takes up to 80 ms.
LIVE, REQUESTS_HZ, CONNECTIONS = 50, 200, 16
EVERY_SAMPLE_EACH = 10
PAGE = {"type": "subscribe", "streams": ["force", "setpoint", "error", "depth", "marker"], "max_rate_hz": 30.0}
WHOLE = {"type": "subscribe", "streams": ["force", "depth"]}
# A page asks for the bench now and then, and a list rarely.
PATHS = ("/rig", "/rig", "/info", "/rig", "/jobs", "/rig", "/rig", "/protocols", "/rig", "/recordings")
BATCH = struct.Struct("<HHIqII")
# As a program beside the bench runs: whoever starts the service computes at this priority too.
LOW_PRIORITY = 10


@dataclass
class Load:
    """What was asked, and what came of it."""

    served: int = 0
    failed: int = 0
    seconds: float = 0.0
    answer_ms: list[float] = field(default_factory=list)
    messages: int = 0
    samples: int = 0
    lost_live: int = 0
    lost_connections: int = 0
    heard: set[int] = field(default_factory=set)
    ended: set[int] = field(default_factory=set)
    """Live clients that got something, and that were thrown out, since this was told last."""

    def told(self) -> dict[str, object]:
        """With times of answers by their percentiles, and live clients by their number."""
        times_ms = self.answer_ms or [float("nan")]
        shown = asdict(self) | {"answer_ms": {f"p{q}": round(float(np.percentile(times_ms, q)), 2) for q in (50, 99)}}
        shown |= {"heard": len(self.heard - self.ended), "ended": len(self.ended)}
        self.heard.clear()
        self.ended.clear()
        return shown


def main() -> None:
    """Until whoever started this closes our standard input."""
    os.nice(LOW_PRIORITY)
    asyncio.run(_loaded(int(sys.argv[1]), os.environ.get("TISSUE_RIG_TOKEN", "")))


async def _loaded(port: int, token: str) -> None:
    load = Load()
    clients = [_watch(load, port, token, number) for number in range(LIVE)]
    requests = [_ask(load, port, token, number) for number in range(CONNECTIONS)]
    began = time.monotonic()
    tasks = [asyncio.ensure_future(_again(load, part)) for part in (*clients, *requests)]
    while await asyncio.to_thread(sys.stdin.readline):
        load.seconds = time.monotonic() - began
        print(json.dumps(load.told()), flush=True)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def watching(port: int, token: str) -> None:
    """The WebSockets alone, for ever."""
    load = Load()
    await asyncio.gather(*(_again(load, _watch(load, port, token, number)) for number in range(LIVE)))


async def _again(load: Load, part: Callable[[], Awaitable[None]]) -> None:
    """A client that is thrown out comes back, and is counted."""
    while True:
        with contextlib.suppress(OSError, ConnectionClosed, asyncio.IncompleteReadError):
            await part()
        load.lost_connections += 1
        await asyncio.sleep(1.0)


def _watch(load: Load, port: int, token: str, number: int) -> Callable[[], Awaitable[None]]:
    offered = [Subprotocol("rig.v1"), *([Subprotocol(f"rig.token.{token}")] if token else [])]
    wanted = json.dumps(PAGE if number % EVERY_SAMPLE_EACH else WHOLE)

    async def watched() -> None:
        address = f"ws://127.0.0.1:{port}/api/v1/stream"
        try:
            async with connect(address, subprotocols=offered, compression=None) as socket:
                await socket.send(wanted)
                await _count(load, socket, number)
        finally:
            load.ended.add(number)
            load.lost_live += 1

    return watched


async def _count(load: Load, socket: ClientConnection, number: int) -> None:
    numbers = Numbers()
    async for message in socket:
        load.messages += 1
        load.heard.add(number)
        came, lost = numbers.take(message)
        load.samples += came
        load.lost_live += lost


class Numbers:
    """Which sample of each channel is due: batches and gaps together account for every number of a run."""

    def __init__(self) -> None:
        self._steps: dict[int, int] = {}
        self._due: dict[int, int] = {}

    def take(self, message: str | bytes) -> tuple[int, int]:
        """How many samples a message stands for, and how many it leaves out; one that comes again leaves out most."""
        if isinstance(message, bytes):
            found = list(batches(message))
            return sum(batch.covered for batch in found), sum(map(self._left_out, found))
        said = json.loads(message) if re.search('"(gap|subscribed|run)"', message) else {}
        match said.get("type"):
            case "subscribed":
                self._steps |= {one["channel"]: one["step"] for one in said["channels"]}
            case "run":
                self._due.clear()
            case "gap" if said["channel"]:
                self._due[said["channel"]] = said["to"] + self._steps[said["channel"]]
                return 0, int(said["dropped"])
        return 0, 0

    def _left_out(self, batch: "Batch") -> int:
        step = self._steps[batch.channel]
        due = self._due.get(batch.channel, batch.seq)
        self._due[batch.channel] = batch.seq + batch.covered * step
        return (batch.seq - due) % 2**32 // step


class Batch(NamedTuple):
    """What the head of a batch says, as docs/api/streams.md has it, and where in the message its columns begin."""

    channel: int
    columns: int
    seq: int
    rows: int
    covered: int
    at: int


def batches(message: bytes) -> Iterator[Batch]:
    """Those of one message, which follow each other."""
    at = 0
    while at < len(message):
        channel, columns, seq, _, rows, covered = BATCH.unpack_from(message, at)
        at += BATCH.size + 4 * rows
        yield Batch(channel, columns, seq, rows, covered, at)
        at += 4 * rows * columns


def _ask(load: Load, port: int, token: str, number: int) -> Callable[[], Awaitable[None]]:
    authorised = f"Authorization: Bearer {token}\r\n" if token else ""

    async def asked() -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        due = time.monotonic() + number / REQUESTS_HZ
        with contextlib.closing(writer):
            for turn in range(number, sys.maxsize):
                await asyncio.sleep(due - time.monotonic())
                path = PATHS[turn % len(PATHS)]
                head = f"GET /api/v1{path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n{authorised}\r\n"
                began = time.monotonic()
                writer.write(head.encode())
                status = await _answered(reader)
                load.answer_ms.append((time.monotonic() - began) * 1e3)
                load.served += status == 200
                load.failed += status != 200
                due += CONNECTIONS / REQUESTS_HZ

    return asked


async def _answered(reader: asyncio.StreamReader) -> int:
    head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").lower()
    length = head.partition("content-length: ")[2].partition("\r\n")[0]
    await reader.readexactly(int(length))
    return int(head.split(" ", 2)[1])


if __name__ == "__main__":
    main()
