"""The bridge as a client of the Foxglove protocol (foxglove.sdk.v1) sees it, written from its specification."""

import json
import socket
import struct
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, cast

import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from api.http.streams.bridge import FoxgloveBridge, bridged
from api.http.streams.events import EventLog
from api.http.streams.feed import Feed
from mock_devices.testing.commands import free_port
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.recording.slots import Slots
from tests.api.streams.played import PlayedBench, force_N

MESSAGE_DATA = 1


@pytest.fixture
def bridge() -> Iterator[tuple[int, FoxgloveBridge]]:
    port = free_port()
    with bridged(port, "abc") as [found]:
        yield port, found


def said(client: ClientConnection, op: str) -> dict[str, Any]:
    while True:
        message = client.recv(10)
        if isinstance(message, str) and json.loads(message)["op"] == op:
            return dict(json.loads(message))


def subscribed(client: ClientConnection, bridge: FoxgloveBridge, *topics: str) -> dict[str, dict[str, Any]]:
    """Channels by topic, the n-th of ``topics`` subscribed with id n."""
    channels = {channel["topic"]: channel for channel in said(client, "advertise")["channels"]}
    while len(channels) < 5:
        channels |= {channel["topic"]: channel for channel in said(client, "advertise")["channels"]}
    wanted = [{"id": number, "channelId": channels[topic]["id"]} for number, topic in enumerate(topics)]
    client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    deadline = time.monotonic() + 10
    while sum(channel.has_sinks() for channel in bridge._channels.values()) < len(topics):
        assert time.monotonic() < deadline, "the subscription did not arrive"
        time.sleep(0.01)
    return channels


def row(channel: dict[str, Any], payload: bytes) -> Any:
    schema = Schema(1, channel["schema"].encode(), channel["schemaEncoding"], channel["schemaName"])
    decoder = DecoderFactory().decoder_for(channel["encoding"], schema)
    assert decoder
    return decoder(payload)


def test_rows_arrive_as_an_independent_decoder_reads_them(bridge: tuple[int, FoxgloveBridge], tmp_path: Path) -> None:
    port, served = bridge
    bench = PlayedBench(tmp_path)
    feed = Feed(Wiring(), lambda: bench, EventLog(), [served.hand_on])
    with connect(f"ws://127.0.0.1:{port}", subprotocols=[Subprotocol("foxglove.sdk.v1")]) as client:
        assert said(client, "serverInfo")["name"] == "tissue-rig"
        channels = subscribed(client, served, "force", "event")
        assert set(channels) == {"force", "axis", "marker", "loop", "event"}
        bench.event("contact", "surface found")
        bench.play(100)
        feed.step()
        found: dict[int, list[tuple[int, bytes]]] = {0: [], 1: []}
        while len(found[0]) < 100 or not found[1]:
            message = client.recv(10)
            assert isinstance(message, bytes)
            opcode, subscription, log_ns = struct.unpack_from("<BIQ", message)
            assert opcode == MESSAGE_DATA
            found[subscription].append((log_ns, message[13:]))
    forces = [row(channels["force"], payload) for _, payload in found[0]]
    assert [force.seq for force in forces] == list(range(100))
    assert [-force.fz_n for force in forces] == pytest.approx([force_N(number) - 0.25 for number in range(100)])
    assert found[0][7][0] == bench.start_ns + 7_000_000
    assert row(channels["event"], found[1][0][1]).text == "surface found"
    feed._let_go()
    bench.close()


def test_what_nobody_has_subscribed_is_not_even_packed(bridge: tuple[int, FoxgloveBridge]) -> None:
    _, served = bridge
    served.hand_on(cast(Slots, None))  # looked at by nobody


def test_a_port_that_is_taken_is_named() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=f"--foxglove {port}: .*give another port"):
            FoxgloveBridge(port, "abc")


def test_without_the_extra_the_command_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(UsageError, match=r"pip install tissue-rig\[foxglove\]"):
        FoxgloveBridge(free_port(), "abc")


def test_without_a_port_there_is_no_bridge() -> None:
    with bridged(None, "abc") as bridges:
        assert bridges == []
