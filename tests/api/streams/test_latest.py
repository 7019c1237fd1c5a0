"""The newest of a stream: in its unit, with number and age, and never an old value as if it were fresh."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx2 as httpx
import pytest

from api.http.streams import latest
from api.http.streams.history import Rows
from api.http.streams.latest import LatestView
from api.http.streams.live_run import LiveRun
from api.http.streams.signals import signals
from mock_devices.testing.commands import until
from rig.config.wiring import Wiring
from rig.recording.tap import RingTap
from tests.api.streams.played import PlayedBench, PlayedService, force_N

MS = 1_000_000


def asked(service: PlayedService, name: str, query: str = "") -> httpx.Response:
    return httpx.get(f"http://127.0.0.1:{service.port}/api/v1/streams/{name}/latest{query}")


def newest(
    service: PlayedService,
    bench: PlayedBench,
    name: str,
    late_ms: int,
    count: int = 1,
    lost: dict[str, str] | None = None,
) -> LatestView:
    """As asked for ``late_ms`` after the newest cycle began."""
    service.caught_up()
    now_ns = bench.start_ns + (bench.cycles - 1 + late_ms) * MS
    return latest.latest(signals(Wiring())[name], service.feed.run, count, now_ns, lost or {})


def test_the_newest_come_with_number_time_age_and_value(service: PlayedService, bench: PlayedBench) -> None:
    bench.play(301)
    found = newest(service, bench, "force", late_ms=30, count=3)
    assert (found.stream, found.unit, found.topic, found.run) == ("force", "N", "force", service.feed.run.id)
    assert (found.state, found.reason, found.last_seen) == ("live", "", None)
    assert [one.seq for one in found.samples] == [298, 299, 300]
    assert [one.time_ns - bench.start_ns for one in found.samples] == [298 * MS, 299 * MS, 300 * MS]
    assert [one.age_s for one in found.samples] == pytest.approx([0.032, 0.031, 0.030])
    assert found.age_s == pytest.approx(0.030)
    expected = [force_N(number) for number in (298, 299, 300)]
    assert [one.values["force_N"] for one in found.samples] == pytest.approx(expected, abs=3e-7)
    assert newest(service, bench, "position", 30).samples[0].values == pytest.approx({"position_mm": 0.3})
    marker = newest(service, bench, "marker", 30)
    assert (marker.unit, marker.step, marker.samples[0].seq) == ("mm", 2, 2 * (300 // 16))
    assert marker.samples[0].values == pytest.approx({"x_mm": 18 * 16 * 0.5, "y_mm": 0.0, "z_mm": 1.0})


def test_fewer_than_asked_for_are_all_there_are(service: PlayedService, bench: PlayedBench) -> None:
    bench.play(2)
    assert len(newest(service, bench, "force", 0, count=1000).samples) == 2


def test_an_old_value_is_never_given_as_fresh(service: PlayedService, bench: PlayedBench) -> None:
    bench.play(300)
    for name in ("force", "position", "depth", "marker", "loop.mode"):
        assert newest(service, bench, name, late_ms=100).state == "live", name
        found = newest(service, bench, name, late_ms=500, count=10)
        assert (found.state, found.samples) == ("stale", []), name
        assert found.last_seen and found.age_s == found.last_seen.age_s >= 0.5, name
    told = newest(service, bench, "force", late_ms=500)
    assert told.reason == "the newest of force is 0.50 s old; look at its device and the bench's state"


def test_what_the_loop_says_again_of_a_silent_sensor_is_as_old_as_the_sensor_s_word(
    service: PlayedService, bench: PlayedBench
) -> None:
    bench.play(10)
    bench.silent = True
    bench.play(400)
    for name in ("force", "error", "loop.force_N"):
        found = newest(service, bench, name, late_ms=0)
        assert (found.state, found.samples) == ("stale", []), name
        assert found.reason.startswith("the newest of force is 0.40 s old"), name
    for name in ("position", "setpoint", "loop.position_mm"):
        assert newest(service, bench, name, late_ms=0).state == "live", name


def test_a_device_that_the_loop_has_lost_is_lost_however_young_its_last_word(
    service: PlayedService, bench: PlayedBench
) -> None:
    bench.play(100)
    lost = {"force": "the sensor is silent"}
    for name in ("force", "compression", "force.fz_N", "error", "loop.force_N"):
        found = newest(service, bench, name, 0, lost=lost)
        assert (found.state, found.samples, found.reason) == ("lost", [], "force is lost: the sensor is silent"), name
        assert found.last_seen and found.last_seen.seq == 99, name
    for name in ("position", "setpoint", "marker"):
        assert newest(service, bench, name, 0, lost=lost).state == "live", name


def test_what_no_device_vouches_for_says_so(service: PlayedService, bench: PlayedBench) -> None:
    bench.play(20)
    found = newest(service, bench, "marker.arm", 0)
    assert (found.state, found.samples) == ("invalid", [])
    assert found.last_seen and found.last_seen.values == {"x_mm": None, "y_mm": None, "z_mm": None}
    assert "a marker that is not seen" in found.reason


def test_before_a_zero_the_force_is_live_and_nobody_knows_it(service: PlayedService, bench: PlayedBench) -> None:
    bench.play(20, zero_N=math.nan)
    assert newest(service, bench, "force", 0).samples[0].values == {"force_N": None}


def test_without_a_sample_or_a_loop_a_stream_is_lost(service: PlayedService, bench: PlayedBench) -> None:
    never: dict[str, Any] = asked(service, "force").json()
    assert (never["state"], never["age_s"], never["samples"], never["last_seen"]) == ("lost", None, [], None)
    assert never["reason"] == "nothing has come of force in this run"
    bench.play(50)
    service.caught_up()
    service.bench = None
    until(lambda: service.feed.run.ended, 20.0, "the end of the run")
    ended = asked(service, "force", "?limit=5").json()
    assert (ended["state"], ended["samples"], ended["last_seen"]["seq"]) == ("lost", [], 49)
    assert ended["reason"] == "no loop runs; connect the bench"


def test_an_unknown_stream_is_told_with_all_that_there_are(service: PlayedService) -> None:
    answer = asked(service, "presure")
    assert (answer.status_code, answer.json()["code"]) == (404, "no-such-stream")
    names = answer.json()["detail"].partition("there are ")[2].split(", ")
    listed = httpx.get(f"http://127.0.0.1:{service.port}/api/v1/streams").json()["items"]
    assert names == [one["name"] for one in listed] and "marker.arm" in names


@pytest.mark.parametrize("query", ["?limit=0", "?limit=1001", "?limit=x"])
def test_a_wrong_number_of_samples_is_422(service: PlayedService, query: str) -> None:
    assert asked(service, "force", query).status_code == 422


@pytest.mark.parametrize(
    ("name", "planted", "judge"),
    [
        ("LATE_NS", 10**12, test_an_old_value_is_never_given_as_fresh),
        ("_doubts", lambda *_: iter(()), test_a_device_that_the_loop_has_lost_is_lost_however_young_its_last_word),
        ("_doubts", lambda *_: iter(()), test_what_no_device_vouches_for_says_so),
        ("SAID_AGAIN", {}, test_what_the_loop_says_again_of_a_silent_sensor_is_as_old_as_the_sensor_s_word),
        ("SAID_AGAIN", {}, test_a_device_that_the_loop_has_lost_is_lost_however_young_its_last_word),
        ("_known", float, test_before_a_zero_the_force_is_live_and_nobody_knows_it),
    ],
)
def test_a_judge_says_no_where_age_loss_or_doubt_is_not_looked_at(
    service: PlayedService,
    bench: PlayedBench,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    planted: object,
    judge: Callable[[PlayedService, PlayedBench], None],
) -> None:
    monkeypatch.setattr(latest, name, planted)
    with pytest.raises(AssertionError):
        judge(service, bench)


def test_no_cycle_is_there_before_the_readings_it_speaks_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench, run = PlayedBench(tmp_path), LiveRun(Wiring())
    tap, loop = RingTap.open(bench.ring_path), run.histories["loop"]
    bench.play(33)
    before, add = list[tuple[int, ...]](), loop.add

    def look(rows: Rows) -> None:
        before.append(tuple(run.histories[name].end for name in ("loop", "force", "axis", "marker.tip")))
        add(rows)

    monkeypatch.setattr(loop, "add", look)
    run.add(tap.take(1 << 12))
    assert before == [(0, 33, 33, 3)]
    tap.close()
    bench.close()
