"""A client that does not read holds up nobody, is told exactly what it did not get, and loses no event."""

import json
import threading
import time

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from api.http.streams.events import EventLog
from api.http.streams.subscriptions import Subscription
from tests.api.streams.foreign_client import ForeignClient
from tests.api.streams.played import PlayedBench, PlayedService

WIDE = ("force", "compression", "position", "depth", "setpoint", "error", "loop.command_mm", "force.fx_N", "force.fy_N")


def played(bench: PlayedBench, seconds: float) -> None:
    """In real time, 1000 cycles a second."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        bench.play(100)
        time.sleep(max(bench.start_ns * 1e-9 + bench.cycles * 1e-3 - time.monotonic(), 0.0))


def stalled(service: PlayedService, bench: PlayedBench) -> tuple[ForeignClient, float]:
    """A client that reads nothing while 12 s are played; beside it one that reads, and the longest it waited [s]."""
    bench.start_ns = time.monotonic_ns()
    with ForeignClient(service.port) as slow, ForeignClient(service.port) as fast:
        slow.subscribe(*WIDE, buffer_s=0.5)
        # All of it, also where this one process, which plays, serves and reads, gets behind itself.
        fast.subscribe("force", buffer_s=30.0)
        playing = threading.Thread(target=played, args=(bench, 12.0))
        playing.start()
        waited_s, last = 0.0, time.monotonic()
        while playing.is_alive():
            fast.take(5.0)
            waited_s, last = max(waited_s, time.monotonic() - last), time.monotonic()
        service.caught_up()
        fast.until(lambda: fast.streams["force"].covered == bench.cycles)
        slow.until(lambda: slow.streams["force"].covered + slow.streams["force"].dropped == bench.cycles)
        return slow, waited_s


@pytest.mark.bench  # in real time: beside tests that compute, the client that reads waited for 1.3 s
def test_a_client_that_reads_nothing_is_told_what_it_missed_to_the_sample(
    service: PlayedService, bench: PlayedBench
) -> None:
    slow, waited_s = stalled(service, bench)
    force = slow.streams["force"]
    assert force.dropped > 1000, "the client was not slow enough to miss anything"
    assert {gap["cause"] for gap in force.gaps} == {"slow"}
    assert all(found.accounts_for_all() for found in slow.streams.values())
    assert waited_s < 1.0


def test_the_judge_says_no_where_a_gap_is_miscounted(
    service: PlayedService, bench: PlayedBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Planted: what was left out is begun one sample too late, and not told.
    genuine = Subscription.gap
    monkeypatch.setattr(
        Subscription,
        "gap",
        lambda self, cut: (gap.model_copy(update={"first": gap.first + 1}) for gap in genuine(self, cut)),
    )
    bench.lose_force(5)
    with ForeignClient(service.port) as client:
        client.subscribe("force")
        bench.play(100)
        bench.lose_force(5)
        bench.play(100)
        client.until(lambda: client.streams["force"].covered == 200)
        assert not client.streams["force"].accounts_for_all()


def test_events_come_in_order_and_none_is_left_out(service: PlayedService, bench: PlayedBench) -> None:
    with ForeignClient(service.port) as client:
        client.subscribe()
        for number in range(50):
            bench.event(f"code_{number}", "text with ümlauts")
        bench.play(1)
        service.events.publish("job", "state", "running", data={"id": "abc"})
        client.until(lambda: len(client.events) == 51)
        assert [event["code"] for event in client.events if event["source"] == "bench"] == [
            f"code_{number}" for number in range(50)
        ]
        numbers = [event["seq"] for event in client.events]
        assert numbers == list(range(numbers[0], numbers[0] + 51))
        assert client.events[-1]["data"] == {"id": "abc"} or client.events[0]["data"] == {"id": "abc"}


def test_who_is_too_far_behind_for_events_is_closed_with_4008_and_told_what_is_gone(
    service: PlayedService, bench: PlayedBench
) -> None:
    service.events = service.feed.events = EventLog(kept=20)
    with ForeignClient(service.port) as client:
        session = client.hello["session_id"]
        client.subscribe()
        for number in range(60):
            service.events.publish("job", str(number), "")  # faster than any turn of the feed
        with pytest.raises(ConnectionClosed) as closed:
            client.until(lambda: False)
        assert closed.value.rcvd and closed.value.rcvd.code == 4008
        assert "since_event" in closed.value.rcvd.reason
    with ForeignClient(service.port) as again:
        again.said.clear()
        again.subscribe(session_id=session, since_event=0)
        again.until(lambda: len(again.events) == 20)
        [gap] = [said for said in again.said if said["type"] == "gap"]
        assert (gap["stream"], gap["from"], gap["to"], gap["dropped"]) == ("events", 1, 40, 40)
        assert [event["code"] for event in again.events] == [str(number) for number in range(40, 60)]


def test_a_quiet_service_says_that_it_is_there_and_answers(service: PlayedService) -> None:
    with ForeignClient(service.port) as client:
        assert json.loads(client.socket.recv(1.0))["type"] == "ping"
        assert client.ask({"type": "ping", "id": 7})["id"] == 7


def test_channels_end_when_asked(service: PlayedService, bench: PlayedBench) -> None:
    with ForeignClient(service.port) as client:
        [channel] = client.subscribe("depth")["channels"]
        assert client.ask({"type": "unsubscribe", "channels": [channel["channel"], 999]})["channels"] == [
            channel["channel"]
        ]
        client.subscribe("force")
        bench.play(100)
        client.until(lambda: client.streams["force"].covered == 100)
        assert client.streams["depth"].covered == 0


def test_without_the_subprotocol_the_answer_says_which_one(service: PlayedService) -> None:
    for offered in (None, [Subprotocol("rig.v2")]):
        with (
            pytest.raises(InvalidStatus) as refused,
            connect(f"ws://127.0.0.1:{service.port}/api/v1/stream", subprotocols=offered),
        ):
            pass
        problem = json.loads(refused.value.response.body)
        assert (refused.value.response.status_code, problem["code"]) == (400, "subprotocol")
        assert "rig.v1" in problem["detail"]
