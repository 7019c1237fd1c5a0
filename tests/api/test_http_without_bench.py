"""The service where no bench answers: state is data, requests are strict, other sites' pages are kept out."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

import hatch_build
from api.http import app
from api.http.service import Service
from mock_devices.testing.access import client_of
from mock_devices.testing.made.synthetic import Bench, write_made_session
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Wiring
from rig.recording.sessions import open_session, write_session

EXAMPLES = Path(__file__).parents[2] / "examples"
PROBLEM = "application/problem+json"
MODEL = {"model": {"session": "a"}}


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    wiring = Wiring(
        force=BotaWiring(port="/dev/no-such-sensor"), axis=Epos4Wiring(port="/dev/no-such-adapter"), tracker=None
    )
    with client_of(Service(wiring, tmp_path_factory.mktemp("sessions"), EXAMPLES)) as client:
        yield client


def test_a_bench_that_is_not_there_is_a_state_with_a_reason_not_an_error(client: TestClient) -> None:
    answer = client.get("/api/v1/rig")
    assert answer.status_code == 200
    assert answer.json()["state"] == "disconnected"
    assert "/dev/no-such-sensor" in answer.json()["reason"]


def test_the_page_loads_nothing_from_outside(client: TestClient) -> None:
    hatch_build.build()
    page = client.get("/")
    policy = page.headers["content-security-policy"]
    assert policy.startswith("default-src 'self'")
    assert "unsafe" not in policy
    named = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert {Path(name).suffix for name in named} == {".js", ".css", ".svg"}
    assert "<style" not in page.text
    for name in named:
        assert name.startswith("/page/")
        answer = client.get(name)
        assert answer.status_code == 200
        # Names of formats, not addresses that anything is loaded from.
        text = re.sub(r"http://www\.w3\.org/\S+?(?=[\"'`])", "", answer.text)
        assert re.findall(r"https?://\w[\w.]*", text) == []


def test_a_checkout_without_its_page_says_so_at_the_pages_address_and_serves_the_rest(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(app, "BUILT", tmp_path)
    page = client.get("/")
    assert page.status_code == 503
    assert "not built" in page.text and "make page" in page.text
    assert client.get("/api/v1/info").status_code == 200


@pytest.mark.parametrize(
    ("body", "wrong"),
    [
        ({"kind": "capture", "params": {"protocol": "indentation"}}, "capture.params.session"),
        ({"kind": "capture", "params": {"protocol": "indentation", "session": "a", "speed": 3}}, "speed"),
        ({"kind": "capture", "params": {"protocol": "indentation", "session": "../../etc"}}, "session"),
        ({"kind": "capture", "params": {"protocol": 7, "session": "a"}}, "protocol"),
        ({"kind": "track", "params": MODEL | {"forces_N": [False]}}, "forces_N"),
        ({"kind": "track", "params": MODEL | {"forces_N": [-1.0]}}, "forces_N"),
        ({"kind": "track", "params": MODEL | {"forces_N": []}}, "one of forces_N, reference and points"),
        ({"kind": "track", "params": MODEL | {"forces_N": [1.0], "seconds": "10"}}, "seconds"),
        ({"kind": "track", "params": MODEL | {"forces_N": [1.0], "reference": "step:5"}}, "one of forces_N"),
        ({"kind": "capture", "session": "a"}, "capture.params"),
        ({"kind": "fit", "params": {}}, "either sessions or upload"),
        ({"kind": "export", "params": {"session": "a", "upload": "0a1b2c3d4e5f"}}, "either session or upload"),
        ({"kind": "report", "params": {"session": "a", "mapping": "x = 1"}}, "a session says it itself"),
        ({"kind": "calibrate", "params": {}}, "kind"),
        ({"kind": "dance"}, "kind"),
    ],
)
def test_a_body_that_is_not_exactly_right_is_refused_naming_the_field(
    client: TestClient, body: dict[str, object], wrong: str
) -> None:
    answer = client.post("/api/v1/jobs", json=body)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == PROBLEM
    assert wrong in answer.json()["detail"]


def test_what_needs_the_bench_says_that_it_is_not_connected(client: TestClient) -> None:
    body = {"kind": "capture", "params": {"protocol": "indentation", "session": "a"}}
    lease = client.post("/api/v1/control/lease", json={"holder": "test"}).json()["lease_id"]
    for path, sent in (("/jobs", body), ("/estop", None), ("/pain", None), ("/estop/reset", None)):
        answer = client.post(f"/api/v1{path}", json=sent, headers={"X-Control-Lease": lease})
        assert (answer.status_code, answer.json()["code"]) == (503, "disconnected")
        assert "/dev/no-such-sensor" in answer.json()["detail"]


@pytest.mark.parametrize(
    "path", ["/jobs/none", "/recordings/none/a.mcap", "/recordings/..%2F..%2Fetc/passwd", "/nothing-here"]
)
def test_what_is_not_there_is_a_problem_document(client: TestClient, path: str) -> None:
    answer = client.get(f"/api/v1{path}")
    assert answer.status_code in {404, 422}
    assert answer.headers["content-type"] == PROBLEM


def test_a_page_of_another_site_may_look_at_nothing_and_move_nothing(client: TestClient) -> None:
    answer = client.post("/api/v1/estop", headers={"Origin": "https://elsewhere.example"})
    assert (answer.status_code, answer.json()["code"]) == (403, "origin")
    rebound = client.get("/api/v1/rig", headers={"Host": "elsewhere.example"})
    assert (rebound.status_code, rebound.json()["code"]) == (403, "host")


def test_protocols_beyond_the_limits_are_listed_with_the_refusal(tmp_path: Path) -> None:
    protocols = tmp_path / "protocols"
    protocols.mkdir()
    (protocols / "deep.toml").write_text('kind = "indentation"\ndepth_mm = 50\n')
    (protocols / "typo.toml").write_text('kind = "indentation"\ndepth_nm = 5\n')
    (protocols / "fine.toml").write_text('kind = "indentation"\ndepth_mm = 5\n')
    wiring = Wiring(force=BotaWiring(port="/dev/no-such-sensor"))
    with client_of(Service(wiring, tmp_path, protocols)) as client:
        listed = {item["name"]: item["refusal"] for item in client.get("/api/v1/protocols").json()["items"]}
    assert listed["fine"] == ""
    assert "50 mm deep, above limits.depth_mm" in listed["deep"]
    assert "nearest valid key: depth_mm" in listed["typo"]


def test_one_bad_file_hides_no_other(tmp_path: Path) -> None:
    protocols, sessions = tmp_path / "protocols", tmp_path / "sessions"
    for folder in (protocols, sessions / "garbage", sessions / "secret"):
        folder.mkdir(parents=True)
    (protocols / "nested.toml").write_text('kind = "indentation"\nspeeds_mm_s = ' + "[" * 3000 + "]" * 3000)
    (protocols / "fine.toml").write_text('kind = "indentation"\n')
    (sessions / "garbage" / "a.mcap").write_bytes(b"no recording at all")
    (sessions / "secret" / "b.mcap").symlink_to("/etc/hostname")
    with client_of(Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), sessions, protocols)) as client:
        listed = {item["name"]: item["refusal"] for item in client.get("/api/v1/protocols").json()["items"]}
        found = {item["name"]: item for item in client.get("/api/v1/recordings").json()["items"]}
        assert client.get("/api/v1/recordings/secret/b.mcap").status_code == 404
    assert listed["fine"] == ""
    assert "nests its values too deeply" in listed["nested"]
    assert found["garbage"]["remarks"] == [
        "session.json is missing: the session is taken from its recordings",
        "a.mcap: not listed in session.json",
    ]


def test_the_quality_of_a_recording_stands_in_the_list(tmp_path: Path) -> None:
    folder = write_made_session(tmp_path / "sessions" / "made", Bench().cycles(trials=1, speeds_mm_s=(10.0,)))
    info = open_session(folder).info
    reason = "force: a gap of 58 ms (good up to 20 ms)"
    write_session(folder, replace(info, trials=(replace(info.trials[0], quality="usable", reasons=(reason,)),)))
    service = Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), tmp_path / "sessions", EXAMPLES)
    with client_of(service) as client:
        (session,) = client.get("/api/v1/recordings").json()["items"]
    found = {entry["file"]: (entry["quality"], entry["reasons"]) for entry in session["recordings"]}
    assert found[info.trials[0].file] == ("usable", [reason])
    assert found["session.json"] == ("", [])


def test_the_interface_description_covers_every_route_and_every_problem(client: TestClient) -> None:
    schema = client.get("/api/v1/openapi.json").json()
    paths = set(schema["paths"])
    assert {"/api/v1/rig", "/api/v1/jobs", "/api/v1/estop", "/api/v1/recordings/{session}/{file}"} <= paths
    for path, operations in schema["paths"].items():
        for method, operation in operations.items():
            assert operation["summary"], (method, path)
            for status, response in operation["responses"].items():
                if int(status) >= 400:
                    assert (PROBLEM in response.get("content", {})) is (method != "head"), (method, path, status)
    assert "Problem" in schema["components"]["schemas"]
    assert "HTTPValidationError" not in str(schema)
