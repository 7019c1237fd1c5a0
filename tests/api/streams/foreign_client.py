"""A client of `rig.v1` written from docs/api/streams.md alone: `websockets`, `struct` and nothing of this program."""

import array
import json
import math
import struct
import time
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Self

from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol


@dataclass
class Received:
    """What came on one stream: rows as (time ns, column values), samples they stand for, and what was said missing."""

    columns: list[str]
    step: int
    times_ns: list[int] = field(default_factory=list)
    values: list[tuple[float, ...]] = field(default_factory=list)
    batches: list[tuple[int, int]] = field(default_factory=list)
    gaps: list[dict[str, Any]] = field(default_factory=list)

    @property
    def covered(self) -> int:
        """Samples that the batches stand for."""
        return sum(count for _, count in self.batches)

    @property
    def dropped(self) -> int:
        """Samples that were said to be missing."""
        return sum(gap["dropped"] for gap in self.gaps)

    @property
    def last_seq(self) -> int:
        """Number of the newest sample."""
        first, count = self.batches[-1]
        return first + (count - 1) * self.step

    @property
    def highest(self) -> float:
        """The largest value, NaN left out."""
        return max(value for row in self.values for value in row if not math.isnan(value))

    def accounts_for_all(self) -> bool:
        """Whether batches and gaps follow each other without a hole and without an overlap."""
        spans = [(seq, seq + (count - 1) * self.step) for seq, count in self.batches]
        spans += [(gap["from"], gap["to"]) for gap in self.gaps]
        spans.sort()
        gaps_right = all(gap["dropped"] == (gap["to"] - gap["from"]) // self.step + 1 for gap in self.gaps)
        follow = all(after[0] == before[1] + self.step for before, after in pairwise(spans))
        return gaps_right and follow


class ForeignClient:
    """One connection; what comes is kept by stream."""

    def __init__(self, port: int, token: str = "", path: str = "/api/v1/stream") -> None:
        offered = [Subprotocol("rig.v1"), *([Subprotocol(f"rig.token.{token}")] if token else [])]
        self._connecting = connect(f"ws://127.0.0.1:{port}{path}", subprotocols=offered, compression=None)
        self.streams: dict[str, Received] = {}
        self.events: list[dict[str, Any]] = []
        self.said: list[dict[str, Any]] = []
        self.channels: list[dict[str, Any]] = []
        self._channels: dict[int, str] = {}

    def __enter__(self) -> Self:
        self.socket: ClientConnection = self._connecting.__enter__()
        assert self.socket.subprotocol == "rig.v1"
        self.hello: dict[str, Any] = json.loads(self.socket.recv(10))
        return self

    def __exit__(self, *_: object) -> None:
        self._connecting.__exit__(None, None, None)

    def ask(self, message: dict[str, Any] | str) -> dict[str, Any]:
        """Sends one message and returns the answer to it; what else comes meanwhile is kept."""
        before = len(self.said)
        self.socket.send(message if isinstance(message, str) else json.dumps(message))
        while len(self.said) == before:
            self.take(10.0)
        return self.said[-1]

    def subscribe(self, *streams: str, **more: Any) -> dict[str, Any]:
        """Asks for streams."""
        return self.ask({"type": "subscribe", "streams": list(streams), **more})

    def took(self) -> bool:
        """Takes what is there already; whether there was anything."""
        try:
            self.take(0.001)
        except TimeoutError:
            return False
        return True

    def take(self, timeout_s: float) -> None:
        """One message; raises TimeoutError where none comes."""
        message = self.socket.recv(timeout_s)
        if isinstance(message, bytes):
            self._batches(message)
            return
        said = json.loads(message)
        match said["type"]:
            case "event":
                self.events.append(said)
            case "gap" if said["channel"]:
                self.streams[said["stream"]].gaps.append(said)
            case "ping":
                pass
            case "subscribed":
                self.channels += said["channels"]
                for channel in said["channels"]:
                    self._channels[channel["channel"]] = channel["stream"]
                    fresh = Received(channel["columns"], channel["step"])
                    self.streams.setdefault(channel["stream"], fresh)
                self.said.append(said)
            case _:
                self.said.append(said)

    def until(self, condition: Any, timeout_s: float = 20.0) -> None:
        """Takes messages until ``condition()``; raises TimeoutError where it does not come true in time."""
        ends_s = time.monotonic() + timeout_s
        while not condition():
            self.take(ends_s - time.monotonic())

    def _batches(self, message: bytes) -> None:
        at = 0
        while at < len(message):
            channel, columns, seq, t0_ns, n, covered = struct.unpack_from("<HHIqII", message, at)
            at += 24
            times = array.array("i", message[at : at + 4 * n])
            at += 4 * n
            table = [array.array("f", message[at + 4 * n * column :][: 4 * n]) for column in range(columns)]
            at += 4 * n * columns
            found = self.streams[self._channels[channel]]
            found.times_ns += [t0_ns + time for time in times]
            found.values += list(zip(*table, strict=True))
            found.batches.append((seq, covered))
        assert at == len(message)
