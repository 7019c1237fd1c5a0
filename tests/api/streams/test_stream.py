"""`rig.v1` as a foreign client sees it: no peak is lost, and no sample without being named."""

import math
from itertools import pairwise, permutations
from pathlib import Path

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed

from api.http.streams import batch, socket
from tests.api.streams.foreign_client import ForeignClient
from tests.api.streams.played import PlayedBench, PlayedService, force_N

PEAK_N = 40.0


def test_hello_says_what_there_is_in_which_unit(service: PlayedService) -> None:
    with ForeignClient(service.port) as client:
        streams = {stream["name"]: stream for stream in client.hello["streams"]}
        units = {name: streams[name]["unit"] for name in ("force", "position", "depth", "setpoint", "error", "marker")}
        assert units == {"force": "N", "position": "mm", "depth": "mm", "setpoint": "N", "error": "N", "marker": "mm"}
        assert (streams["marker"]["step"], streams["marker"]["rate_hz"]) == (2, 60.0)
        assert streams["force.fz_N"]["topic"] == "force"
        assert client.hello["monotonic_ns"] > 0 and client.hello["session_id"] == "0" * 32


def test_every_sample_comes_with_its_number_time_and_value(service: PlayedService, bench: PlayedBench) -> None:
    with ForeignClient(service.port) as client:
        # What is played at once is more than the two seconds by which a client may be behind unless it says so.
        client.subscribe("force", "compression", "position", "error", "marker", "marker.arm", buffer_s=30.0)
        bench.play(3000)
        client.until(lambda: all(client.streams[name].covered == 3000 for name in ("force", "position", "error")))
        client.until(lambda: client.streams["marker"].covered == math.ceil(3000 / 16))
        found = client.streams
        assert found["force"].batches[0][0] == 0 and found["force"].accounts_for_all() and not found["force"].gaps
        assert found["force"].times_ns == [bench.start_ns + number * 1_000_000 for number in range(3000)]
        expected = np.array([force_N(number) for number in range(3000)])
        assert np.array(found["force"].values)[:, 0] == pytest.approx(expected, abs=3e-7)
        assert np.array(found["compression"].values)[:, 0] == pytest.approx(expected - 0.25, abs=3e-7)
        assert np.array(found["error"].values)[:, 0] == pytest.approx(3.0 - expected, abs=3e-7)
        assert found["position"].values[-1] == pytest.approx((2.999,), abs=1e-6)
        assert found["marker"].columns == ["x_mm", "y_mm", "z_mm"]
        assert found["marker"].values[3] == (24.0, 0.0, 1.0) and found["marker"].accounts_for_all()
        assert all(map(math.isnan, found["marker.arm"].values[0]))


def seen(service: PlayedService, bench: PlayedBench, rate_hz: float, decimate: str) -> float:
    """The highest force that a client of that rate is shown, of a run with a peak of one sample in it."""
    bench.peaks = {1234: PEAK_N}
    with ForeignClient(service.port) as client:
        client.subscribe("force", max_rate_hz=rate_hz, decimate=decimate)
        for _ in range(5):
            bench.play(500)
            service.caught_up()
        client.until(lambda: client.streams["force"].covered >= 2500 - 1000 / rate_hz)
        assert client.streams["force"].accounts_for_all()
        # A part to which samples came late is one row more.
        found = client.streams["force"]
        assert len(found.values) <= 2.5 * rate_hz + 1 + len(found.batches)
        return client.streams["force"].highest


@pytest.mark.parametrize("rate_hz", [1.0, 7.3, 30.0, 50.0, 333.3, 999.0])
def test_a_peak_of_one_sample_is_seen_at_any_rate(service: PlayedService, bench: PlayedBench, rate_hz: float) -> None:
    assert seen(service, bench, rate_hz, "minmax") == PEAK_N


def test_the_judge_says_no_where_a_peak_is_lost(
    service: PlayedService, bench: PlayedBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Planted: what is asked for as min/max says the least twice.
    genuine = batch._decimated
    monkeypatch.setattr(batch, "_decimated", lambda values, how, starts: 2 * genuine(values, how, starts)[:1])
    assert seen(service, bench, 30.0, "minmax") < PEAK_N


def test_last_shows_the_newest_of_each_part(service: PlayedService, bench: PlayedBench) -> None:
    assert seen(service, bench, 1.0, "last") < PEAK_N


def test_samples_that_never_came_are_a_gap(service: PlayedService, bench: PlayedBench) -> None:
    with ForeignClient(service.port) as client:
        client.subscribe("force", max_rate_hz=50.0)
        client.subscribe("position")
        bench.play(1000)
        bench.lose_force(7)
        bench.play(1000)
        client.until(lambda: client.streams["position"].covered == 2000)
        client.until(lambda: bool(client.streams["force"].gaps))
        [gap] = client.streams["force"].gaps
        assert (gap["from"], gap["to"], gap["dropped"], gap["cause"]) == (1000, 1006, 7, "source")


def test_before_a_zero_force_is_not_known_and_compression_is(service: PlayedService, bench: PlayedBench) -> None:
    with ForeignClient(service.port) as client:
        client.subscribe("force", "compression")
        bench.play(10, zero_N=math.nan)
        client.until(lambda: client.streams["force"].covered == 10)
        assert all(math.isnan(value) for (value,) in client.streams["force"].values)


def test_who_comes_back_gets_what_was_missed(service: PlayedService, bench: PlayedBench) -> None:
    with ForeignClient(service.port) as client:
        client.subscribe("force", "marker", max_rate_hz=50.0)
        bench.event("first")
        bench.play(1500)
        client.until(lambda: client.streams["force"].covered > 1000 and client.events != [])
        hello, force, marker = client.hello, client.streams["force"], client.streams["marker"]
        last_event = client.events[-1]["seq"]
    bench.event("second")
    bench.play(1500)
    bench.event("third")
    bench.play(100)
    service.caught_up()
    with ForeignClient(service.port) as again:
        answer = again.subscribe(
            "force", "marker", max_rate_hz=50.0, run=hello["run"], session_id=hello["session_id"],
            since_event=last_event, since_seq={"force": force.last_seq, "marker": marker.last_seq},
        )  # fmt: skip
        assert answer["resumed"] is True
        again.until(lambda: len(again.events) == 2)
        assert [event["code"] for event in again.events] == ["second", "third"]
        again.until(lambda: again.streams["force"].covered > 3000 - force.last_seq)
        assert again.streams["force"].batches[0][0] == force.last_seq + 1
        assert again.streams["force"].accounts_for_all() and not again.streams["force"].gaps
        assert again.streams["marker"].batches[0][0] == marker.last_seq + 2


RESUMED = {"streams": ["force"], "since_seq": {"force": 199}}
MESSAGES: dict[str, dict[str, object]] = {
    "all": {"type": "subscribe", "streams": ["force"]},
    "from 200": {"type": "subscribe", **RESUMED},
    "end": {"type": "unsubscribe", "channels": []},
    "ask": {"type": "ping", "id": 7},
}


@pytest.mark.parametrize("order", list(permutations(MESSAGES)), ids=", ".join)
def test_messages_in_any_order_are_answered_in_it_and_the_last_one_counts(
    service: PlayedService, bench: PlayedBench, order: tuple[str, ...]
) -> None:
    bench.play(500)
    service.caught_up()
    with ForeignClient(service.port) as client:
        for name in order:
            named = MESSAGES[name] | ({"run": client.hello["run"]} if name == "from 200" else {})
            ended = {"channels": [each["channel"] for each in client.channels]} if name == "end" else {}
            before = len(client.streams["force"].batches) if "force" in client.streams else 0
            answer = client.ask(named | ended)
            assert (
                answer["type"]
                == {"subscribe": "subscribed", "unsubscribe": "unsubscribed", "ping": "pong"}[str(named["type"])]
            )
            if name in ("all", "from 200"):
                last, since = name, before
        bench.play(500)
        if order.index("end") > max(order.index("all"), order.index("from 200")):
            told = len(client.streams["force"].batches)
            service.caught_up()
            client.ask(MESSAGES["ask"])
            assert len(client.streams["force"].batches) == told
            return
        force = client.streams["force"]
        client.until(lambda: force.batches and force.last_seq == 999)
        spans = force.batches[since:]
        assert spans[0][0] == (200 if last == "from 200" else spans[0][0])
        assert all(after[0] == before[0] + before[1] for before, after in pairwise(spans))
        assert not force.gaps


def test_what_is_older_than_a_minute_is_a_gap_with_its_size(service: PlayedService, bench: PlayedBench) -> None:
    with ForeignClient(service.port) as client:
        run = client.hello["run"]
    for _ in range(18):
        bench.play(4000)
        service.caught_up()
    with ForeignClient(service.port) as client:
        client.subscribe("force", run=run, since_seq={"force": 99})
        client.until(lambda: client.streams["force"].batches != [])
        [gap] = client.streams["force"].gaps
        kept = service.feed.run.histories["force"].end - service.feed.run.histories["force"].start
        assert (gap["from"], gap["cause"]) == (100, "expired")
        assert gap["dropped"] == 72_000 - kept - 100
        client.until(lambda: client.streams["force"].covered == kept)
        assert client.streams["force"].accounts_for_all()


def test_another_run_begins_anew_and_says_so(service: PlayedService, bench: PlayedBench, tmp_path: Path) -> None:
    with ForeignClient(service.port) as client:
        client.subscribe("force")
        bench.play(100)
        client.until(lambda: client.streams["force"].covered == 100)
        service.bench = PlayedBench(tmp_path, "second")
        client.until(lambda: any(said["type"] == "run" for said in client.said))
        service.bench.play(50)
        client.until(lambda: client.streams["force"].covered == 150)
        assert client.streams["force"].batches[-1][0] < 50
        run = next(said["run"] for said in client.said if said["type"] == "run")
        assert run != client.hello["run"]
        resumed = client.subscribe("force", run=client.hello["run"], since_seq={"force": 10})
        assert resumed["resumed"] is False
        service.bench.close()
        service.bench = None


@pytest.mark.parametrize(
    ("message", "code", "word"),
    [
        ("{", "invalid-message", "JSON"),
        ("[]", "invalid-message", "object"),
        ({"type": "dance"}, "invalid-message", "type"),
        ({"type": "subscribe", "streams": ["nothing"]}, "no-such-stream", "nothing"),
        ({"type": "subscribe", "streams": ["force"], "max_rate_hz": 0}, "invalid-message", "max_rate_hz"),
        ({"type": "subscribe", "streams": ["force"], "max_rate_hz": "30"}, "invalid-message", "max_rate_hz"),
        ({"type": "subscribe", "streams": ["force"], "max_rate_hz": False}, "invalid-message", "max_rate_hz"),
        ({"type": "subscribe", "streams": ["force"], "rate": 30}, "invalid-message", "rate"),
        ({"type": "subscribe", "streams": ["force"], "decimate": "minmax"}, "no-rate", "max_rate_hz"),
        ({"type": "subscribe", "streams": ["force"], "decimate": "none", "max_rate_hz": 5}, "rate", "minmax"),
        ({"type": "subscribe", "streams": ["force"] * 65}, "invalid-message", "streams"),
        ({"type": "subscribe", "streams": ["force"], "since_seq": {"force": -1}}, "invalid-message", "since_seq"),
    ],
)
def test_what_is_not_understood_is_said_and_the_rest_goes_on(
    service: PlayedService, bench: PlayedBench, message: dict[str, object] | str, code: str, word: str
) -> None:
    with ForeignClient(service.port) as client:
        client.subscribe("depth")
        answer = client.ask(message)
        assert (answer["type"], answer["code"]) == ("error", code)
        assert word in answer["detail"]
        bench.play(100)
        client.until(lambda: client.streams["depth"].covered == 100)


def test_whoever_may_not_look_on_any_more_is_told_so(service: PlayedService, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "RECHECK_S", 0.05)
    with ForeignClient(service.port) as client:
        client.subscribe("force")
        service.entitled = False
        with pytest.raises(ConnectionClosed) as closed:
            client.until(lambda: False)
        assert closed.value.rcvd
        assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1008, socket.RIGHT_ENDED)
