"""The service where no bench answers: state is data, requests are strict, other sites' pages are kept out."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.app import build
from api.http.service import Service
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Wiring
from rig.recording.sessions import open_session, write_session
from tests.rig.tissue.synthetic import Bench, write_made_session

EXAMPLES = Path(__file__).parents[2] / "examples"
PROBLEM = "application/problem+json"


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    wiring = Wiring(
        force=BotaWiring(port="/dev/no-such-sensor"), axis=Epos4Wiring(port="/dev/no-such-adapter"), tracker=None
    )
    with TestClient(
        build(Service(wiring, tmp_path_factory.mktemp("sessions"), EXAMPLES)), base_url="http://127.0.0.1:8000"
    ) as client:
        yield client


def test_a_bench_that_is_not_there_is_a_state_with_a_reason_not_an_error(client: TestClient) -> None:
    answer = client.get("/api/v1/rig")
    assert answer.status_code == 200
    assert answer.json()["state"] == "disconnected"
    assert "/dev/no-such-sensor" in answer.json()["reason"]


def test_the_page_loads_nothing_from_outside(client: TestClient) -> None:
    page = client.get("/")
    assert page.headers["content-security-policy"].startswith("default-src 'self'")
    for name in ("page.js", "plot.js", "style.css", "icon.svg"):
        assert f"/page/{name}" in page.text or name == "icon.svg"
        text = client.get(f"/page/{name}").text
        assert "http://" not in text.replace("http://www.w3.org/2000/svg", "")
        assert "https://" not in text


@pytest.mark.parametrize(
    ("body", "wrong"),
    [
        ({"kind": "capture", "protocol": "indentation"}, "session"),
        ({"kind": "capture", "protocol": "indentation", "session": "a", "speed": 3}, "speed"),
        ({"kind": "capture", "protocol": "indentation", "session": "../../etc"}, "session"),
        ({"kind": "capture", "protocol": 7, "session": "a"}, "protocol"),
        ({"kind": "track", "session": "a", "forces_N": [False]}, "forces_N"),
        ({"kind": "track", "session": "a", "forces_N": [-1.0]}, "forces_N"),
        ({"kind": "track", "session": "a", "forces_N": []}, "forces_N"),
        ({"kind": "track", "session": "a", "forces_N": [1.0], "seconds": "10"}, "seconds"),
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
    body = {"kind": "capture", "protocol": "indentation", "session": "a"}
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
    with TestClient(build(Service(wiring, tmp_path, protocols)), base_url="http://127.0.0.1:8000") as client:
        listed = {item["name"]: item["refusal"] for item in client.get("/api/v1/protocols").json()}
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
    with TestClient(
        build(Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), sessions, protocols)),
        base_url="http://127.0.0.1:8000",
    ) as client:
        listed = {item["name"]: item["refusal"] for item in client.get("/api/v1/protocols").json()}
        found = {item["name"]: item for item in client.get("/api/v1/recordings").json()}
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
    app = build(Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), tmp_path / "sessions", EXAMPLES))
    with TestClient(app, base_url="http://127.0.0.1:8000") as client:
        (session,) = client.get("/api/v1/recordings").json()
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
                    assert PROBLEM in response["content"], (method, path, status)
    assert "Problem" in schema["components"]["schemas"]
    assert "HTTPValidationError" not in str(schema)
