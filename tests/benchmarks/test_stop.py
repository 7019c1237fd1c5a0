"""The benchmark of the stop says no to every figure that is not good enough, and to a load that was not there."""

import asyncio
import contextlib
import http.server
import itertools
import json
import threading
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from benchmarks import stop
from benchmarks.service import clients
from benchmarks.service.load import Clients
from benchmarks.stop import GIVEN_UP_MS, PHASES, Load, Phase, Stops, came, missed, pressed, summary
from mock_devices.testing.commands import free_port

QUICK, SERVED = Stops(300, 3.1, 6.2, 9.0, 0), Load(199.6, 50, 0, 40)
GOOD = [Phase(name, QUICK, SERVED if asked == "served" else Load()) for name, asked in PHASES.items()]
LOADED = [name for name, asked in PHASES.items() if asked == "served"]
HUNG = "stop process, service suspended"


def planted(name: str, stops: dict[str, Any], load: dict[str, Any]) -> list[Phase]:
    """The good figures, but for some of one phase."""
    return [
        replace(phase, stops=replace(phase.stops, **stops), load=replace(phase.load, **load))
        if phase.name == name
        else phase
        for phase in GOOD
    ]


def test_good_figures_are_let_pass() -> None:
    assert missed(GOOD) == []


@pytest.mark.parametrize(
    ("counts", "looks"),
    [
        ([(0, 0), (380, 50)], 1),
        ([(0, 0), (100, 50), (480, 49), (860, 50)], 3),
        ([(0, 0)] * 9, 5),  # ten seconds, which is as long as it may take here
    ],
)
def test_the_load_is_waited_for(monkeypatch: pytest.MonkeyPatch, counts: list[tuple[int, int]], looks: int) -> None:
    clock = [0.0]
    time = SimpleNamespace(monotonic=lambda: clock[0], sleep=lambda seconds: clock.__setitem__(0, clock[0] + seconds))
    monkeypatch.setattr(stop, "time", time)
    monkeypatch.setattr(stop, "SETTLING_S", 10.0)
    told = iter(counts)

    def counted() -> dict[str, float]:
        served, heard = next(told)
        return {"served": served, "heard": heard, "seconds": clock[0], "ended": 0, "bodies": 1}

    stop.await_load(cast(stop.Loading, SimpleNamespace(counted=counted)))
    assert clock[0] == looks * stop.LOOK_S


@pytest.mark.parametrize("name", PHASES)
@pytest.mark.parametrize(
    ("bad", "sentence"),
    [
        ({"p99_ms": 20.0}, "99 of 100 presses within 20 ms, not within 20 ms"),
        ({"p99_ms": float("nan")}, "99 of 100 presses within nan ms"),
        ({"not_confirmed": 1}, "1 of 300 presses were not confirmed"),
        ({"presses": 99}, "99 presses, at least 100 are needed"),
    ],
)
def test_a_stop_that_is_late_or_lost_is_told_of_every_phase(name: str, bad: dict[str, Any], sentence: str) -> None:
    (said,) = missed(planted(name, bad, {}))
    assert said.startswith(f"{name}: {sentence}")


@pytest.mark.parametrize("name", LOADED)
@pytest.mark.parametrize(
    ("bad", "sentence"),
    [
        ({"served_Hz": 189.9}, "189.9 requests a second were served, not 190"),
        ({"served_Hz": float("nan")}, "nan requests a second were served, not 190"),
        ({"live": 49}, "49 of 50 streams brought something all the time"),
        ({"ended": 1}, "1 of 50 streams ended"),
        ({"bodies": 0}, "no large body was sent"),
    ],
)
def test_a_load_that_was_not_there_is_told(name: str, bad: dict[str, Any], sentence: str) -> None:
    assert missed(planted(name, {}, bad)) == [f"{name}: {sentence}"]


@pytest.mark.parametrize(
    ("bad", "sentence"),
    [
        ({"served_Hz": 0.4}, "the service answered: it was not suspended"),
        ({"live": 1}, "the service answered: it was not suspended"),
        ({"ended": 50}, "50 of 50 streams ended"),
    ],
)
def test_a_service_that_was_not_suspended_is_told(bad: dict[str, Any], sentence: str) -> None:
    assert missed(planted(HUNG, {}, bad)) == [f"{HUNG}: {sentence}"]


@pytest.mark.parametrize("name", PHASES)
def test_a_phase_that_was_left_out_is_told(name: str) -> None:
    assert missed([phase for phase in GOOD if phase.name != name]) == [f"{name}: was not measured"]


def test_a_press_that_nobody_confirms_counts_as_the_slowest() -> None:
    assert summary([3.0] * 299 + [GIVEN_UP_MS]) == Stops(300, 3.0, 3.0, GIVEN_UP_MS, 1)
    assert summary([3.0] * 297 + [GIVEN_UP_MS] * 3).p99_ms == GIVEN_UP_MS
    assert pressed(free_port(), "/estop", 2) == [GIVEN_UP_MS] * 2


def test_what_came_is_what_there_is_more_of_than_before() -> None:
    before = {"served": 100, "seconds": 2.0, "heard": 3, "ended": 9, "bodies": 5}
    after = {"served": 600, "seconds": 4.5, "heard": 50, "ended": 1, "bodies": 7}
    assert came(before, after) == Load(200.0, 50, 1, 2)


def test_clients_whose_process_has_died_are_a_load_that_was_not_there() -> None:
    with Clients(free_port()) as dying:
        before = dying.counted()
        assert before["served"] == 0
        dying._process.kill()
        dying._process.wait()
        died = came(before | {"bodies": 1}, dying.counted() | {"bodies": 9})
    assert died == Load(ended=50)
    found = missed([replace(phase, load=died) if phase.name in (*LOADED, HUNG) else phase for phase in GOOD])
    assert {said.partition(": ")[0] for said in found} == {*LOADED, HUNG}


@contextlib.contextmanager
def answering(statuses: Iterator[int]) -> Iterator[int]:
    """The port of a service that answers each request with the next status."""

    class Answering(http.server.BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            self.send_response(next(statuses))
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, format: str, *arguments: object) -> None:
            """Says nothing."""

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Answering) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever).start()
        yield server.server_port
        server.shutdown()


def test_only_answers_of_200_count_as_served() -> None:
    load, answered = clients.Load(), itertools.cycle([200, 503, 404])

    async def asked(port: int) -> None:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(clients._ask(load, port, "", 0)(), 1.0)

    with answering(answered) as port:
        asyncio.run(asked(port))
    assert load.served >= 1 and load.served <= load.failed <= 2 * load.served + 2


def test_a_stream_that_ended_is_not_one_that_brought_something() -> None:
    load = clients.Load(heard={1, 2, 3}, ended={3, 4})
    told = load.told()
    assert (told["heard"], told["ended"]) == (2, 2)
    again = load.told()
    assert (again["heard"], again["ended"]) == (0, 0)


@pytest.mark.parametrize(("stops", "code"), [({}, 0), ({"not_confirmed": 1}, 1), ({"p99_ms": 21.0}, 1)])
def test_the_command_ends_with_1_and_an_object_of_all_figures(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], stops: dict[str, Any], code: int
) -> None:
    running = SimpleNamespace(process=SimpleNamespace(terminate=lambda: None), end=lambda: None)
    bench = SimpleNamespace(settings=lambda *_: [])
    monkeypatch.setattr(stop, "served_bench", lambda *_: contextlib.nullcontext(bench))
    monkeypatch.setattr(stop, "ServedRig", lambda *_: SimpleNamespace(running=running))
    monkeypatch.setattr(stop, "measured", lambda *_: planted(HUNG, stops, {}))
    monkeypatch.setattr("sys.argv", ["stop"])
    assert stop.main() == code
    *said, last = capsys.readouterr().out.splitlines()
    found = json.loads(last)
    assert found["ok"] is (code == 0) and len(found["missed"]) == code
    assert found["phases"][2]["load"]["served_Hz"] == 199.6
    page = "\n".join(said)
    assert "| commit | " in page and "| command | `python -m benchmarks.stop` |" in page
    assert "| service, under load | 300 | 3.1 | 6.2 | 9.0 | 0 | 199.6 | 50 | 0 | 40 |" in page
