"""Events for scripts: read as the standard of server-sent events says, by a client of raw HTTP."""

import contextlib
import http.client
import json
from collections.abc import Iterator
from typing import Any

import pytest

from api.http.streams.events import EventLog
from tests.api.streams.played import SESSION, PlayedBench, PlayedService


@contextlib.contextmanager
def told(port: int, headers: dict[str, str] | None = None, query: str = "") -> Iterator[Iterator[tuple[str, str, Any]]]:
    """(id, event, data) of each event that comes."""
    with (
        contextlib.closing(http.client.HTTPConnection("127.0.0.1", port, timeout=10)) as client,
        contextlib.closing(asked(client, headers or {}, query)) as answer,
    ):
        assert (answer.status, answer.headers["content-type"]) == (200, "text/event-stream; charset=utf-8")
        yield parsed(iter(answer.readline, b""))


def asked(client: http.client.HTTPConnection, headers: dict[str, str], query: str) -> http.client.HTTPResponse:
    client.request("GET", f"/api/v1/events{query}", headers=headers)
    return client.getresponse()


def parsed(lines: Iterator[bytes]) -> Iterator[tuple[str, str, Any]]:
    fields: dict[str, str] = {}
    for line in lines:
        name, _, value = line.decode().rstrip("\n").partition(": ")
        if name:
            fields[name] = value
        elif "data" in fields:
            yield fields.get("id", ""), fields["event"], json.loads(fields["data"])
            fields = {}


def test_what_happened_since_the_start_can_be_asked_for(service: PlayedService, bench: PlayedBench) -> None:
    bench.event("contact", "surface found")
    bench.play(1)
    with told(service.port, query="?since=0") as events:
        identifier, kind, data = next(events)
        assert (identifier, kind, data["code"], data["text"]) == (f"{SESSION}-1", "bench", "contact", "surface found")
        assert data["time_ns"] == bench.start_ns
        service.events.publish("job", "state", "done")
        assert next(events)[0] == f"{SESSION}-2"


def test_who_comes_back_with_the_last_id_loses_nothing(service: PlayedService, bench: PlayedBench) -> None:
    for number in range(5):
        service.events.publish("job", str(number), "")
    with told(service.port, {"Last-Event-ID": f"{SESSION}-2"}) as back:
        assert [next(back)[2]["code"] for _ in range(3)] == ["2", "3", "4"]
    with told(service.port, {"Last-Event-ID": f"{'1' * 32}-4"}) as other:
        assert next(other)[2]["code"] == "0", "another service's number says nothing here"


def test_what_is_not_kept_any_more_is_named(service: PlayedService, bench: PlayedBench) -> None:
    service.events = service.feed.events = EventLog(kept=3)
    for number in range(5):
        service.events.publish("job", str(number), "")
    with told(service.port, {"Last-Event-ID": f"{SESSION}-0"}) as events:
        _, kind, gap = next(events)
        assert (kind, gap["from"], gap["to"], gap["dropped"]) == ("gap", 1, 2, 2)
        assert next(events)[2]["code"] == "2"


@pytest.mark.parametrize("wrong", ["7", "abc-1", f"{SESSION}--1"])
def test_an_id_that_nobody_gave_is_refused(service: PlayedService, wrong: str) -> None:
    with (
        contextlib.closing(http.client.HTTPConnection("127.0.0.1", service.port, timeout=10)) as client,
        contextlib.closing(asked(client, {"Last-Event-ID": wrong}, "")) as answer,
    ):
        assert answer.status == 422
