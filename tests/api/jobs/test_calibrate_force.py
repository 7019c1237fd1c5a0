"""The force sensor calibrated by a job: refused before the loop ends, then the ports are its own, and nothing homes."""

import http.client
import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.http.service import Service
from mock_devices.testing.commands import until
from rig.config.products.firmata_glove import FirmataGlove
from tests.api.jobs import test_verbs
from tests.api.jobs.asked import becomes, begun, ended
from tests.api.jobs.test_verbs import WiredBench

bench = test_verbs.bench
ASKED: dict[str, Any] = {"weights": "1 N,2 N", "load": "pressed"}
PLANTED = "tests.api.jobs.planted:asking"


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"weights": "1 N"}, "1 given; 2 or more"),
        ({"weights": "1 N,400 N"}, "400 N is above limits.force_N"),
        ({"weights": "1 N,one pound"}, "'one pound' is no weight"),
        ({"load": "thrown"}, "load: Input should be 'pressed' or 'hung'"),
        ({"weights": ""}, "weights: String should have at least 1 character"),
    ],
)
def test_what_cannot_be_calibrated_with_is_refused_while_the_bench_goes_on(
    client: TestClient, bench: WiredBench, changed: dict[str, str], said: str
) -> None:
    refused = client.post("/api/v1/jobs", json={"kind": "calibrate-force", "params": ASKED | changed})
    assert refused.status_code == 422 and said in refused.json()["detail"], refused.text
    assert bench.alive


def test_it_takes_the_lease_and_waits_for_an_acknowledgement(client: TestClient, bench: WiredBench) -> None:
    body = {"kind": "calibrate-force", "params": ASKED}
    stale = client.post("/api/v1/jobs", json=body, headers={"X-Control-Lease": "stale"})
    assert (stale.status_code, stale.json()["code"]) == (423, "no-lease")
    bench.status = {"latched": {"code": "pain_stop", "text": "the subject's stop", "action": "SOFT"}}
    stopped = client.post("/api/v1/jobs", json=body)
    assert (stopped.status_code, stopped.json()["code"]) == (409, "stopped")
    assert bench.alive


def test_the_loop_ends_for_it_and_a_person_connects_again(
    client: TestClient, service: Service, bench: WiredBench
) -> None:
    service.works["calibrate-force"] = PLANTED
    job = begun(client, "calibrate-force", **ASKED)
    asks = becomes(client, job, "paused")
    assert (asks["message"], asks["can"]) == ("put 1 N on the tip", ["cancel", "resume"])
    shown = client.get("/api/v1/rig").json()
    assert (shown["state"], bench.alive) == ("disconnected", False)
    assert "nothing moves" in shown["reason"]
    for path in ("/rig/connect", "/recover"):
        busy = client.post(f"/api/v1{path}", json={})
        assert (busy.status_code, busy.json()["code"]) == (409, "busy")
    client.post(f"/api/v1/jobs/{job}/cancel")
    assert ended(client, job)["state"] == "cancelled"
    until(lambda: "then connect" in client.get("/api/v1/rig").json()["reason"], 10.0, "the devices free again")
    assert service.bench is None, "nothing homes by itself beside a hand that took weights away"


@pytest.mark.parametrize("kind", ["calibrate-force", "calibrate-glove", "calibrate-axis", "calibrate-dynamics"])
def test_where_the_result_could_not_be_written_is_said_while_the_bench_goes_on(
    client: TestClient, bench: WiredBench, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "calibration").write_text("")
    params = {"calibrate-force": ASKED, "calibrate-glove": {"weights": "1 N,2 N"}}.get(kind, {})
    refused = client.post("/api/v1/jobs", json={"kind": kind, "params": params})
    assert refused.status_code == 422 and "is a file, not a folder" in refused.json()["detail"], refused.text
    assert bench.alive


def by_the_service(client: TestClient) -> str:
    answer = client.post("/api/v1/estop")
    assert answer.status_code == 200, answer.text
    return str(answer.json()["detail"])


def by_the_stop_process(client: TestClient) -> str:
    port = client.get("/api/v1/info").json()["stop_port"]
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=10)) as asked:
        asked.request("POST", "/pain")
        answer = asked.getresponse()
        assert answer.status == 200
        return str(json.load(answer)["done"])


@pytest.mark.parametrize("stopped", [by_the_service, by_the_stop_process])
@pytest.mark.parametrize(("kind", "asked"), [("calibrate-force", ASKED), ("calibrate-glove", {"weights": "1 N,2 N"})])
def test_a_stop_while_nothing_moves_says_so_and_ends_the_job(
    client: TestClient, service: Service, bench: WiredBench, kind: str, asked: dict[str, Any],
    stopped: Callable[[TestClient], str],
) -> None:  # fmt: skip
    service.wiring = service.wiring.model_copy(update={"input": {"hand": FirmataGlove()}})
    service.works[kind] = PLANTED
    job = begun(client, kind, **asked)
    becomes(client, job, "paused")
    assert stopped(client) == "nothing was moving: the axis stays where it is"
    assert ended(client, job)["state"] == "cancelled"
    until(lambda: client.get("/api/v1/info").json()["stop_port"] == 0, 10.0, "the end of the stop process")
    assert client.post("/api/v1/estop").status_code == 503


def test_a_sensor_that_is_not_there_is_named(client: TestClient, bench: WiredBench) -> None:
    done = ended(client, begun(client, "calibrate-force", **ASKED))
    assert (done["state"], done["problem"]["code"]) == ("failed", "device")
    assert "/dev/no-such-sensor" in done["message"]
