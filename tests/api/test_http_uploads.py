"""Files are sent in parts, written whole or not at all, and imported from there."""

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.http import uploads
from api.http.access.scopes import Scope
from api.http.problems import RequestRefused
from api.http.service import Service
from api.http.uploads import UploadShelf
from mock_devices.testing.access import bearer, client_of
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring
from tests.api.jobs.asked import begun, ended
from tests.rig.recording.measured import measured

ROUTE = "/api/v1/uploads"


@pytest.fixture
def service(tmp_path: Path) -> Service:
    return Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), tmp_path / "sessions", tmp_path)


@pytest.fixture
def client(service: Service) -> TestClient:
    return client_of(service)


def sent(client: TestClient, files: dict[str, bytes]) -> Any:
    return client.post(ROUTE, files=[("file", (name, content)) for name, content in files.items()])


def left(service: Service) -> list[str]:
    root = service.jobs.uploads
    return [path.name for path in root.iterdir()] if root.exists() else []


def test_files_are_kept_as_they_were_sent_with_their_folders(client: TestClient, service: Service) -> None:
    binary = bytes(range(256)) * 9000
    answer = sent(client, {"a.csv": b"1,2\n", "force/b ü.bin": binary, "empty.txt": b"", ".DS_Store": b"x"})
    assert answer.status_code == 201, answer.text
    found = answer.json()
    assert found["files"] == [
        {"name": "a.csv", "bytes": 4},
        {"name": "empty.txt", "bytes": 0},
        {"name": "force/b ü.bin", "bytes": len(binary)},
    ]  # fmt: skip
    assert (found["bytes"], found["left_out"]) == (len(binary) + 4, [".DS_Store"])
    assert (service.jobs.uploads / found["id"] / "force" / "b ü.bin").read_bytes() == binary
    assert client.get(ROUTE).json() == [{**found, "left_out": []}]
    assert client.delete(f"{ROUTE}/{found['id']}").status_code == 200
    assert client.get(f"{ROUTE}/{found['id']}").status_code == 404 and left(service) == []


@pytest.mark.parametrize(
    "name", ["../out.csv", "/etc/passwd", "a/../../b", "a//b", "..\\out.csv", "x" * 201, "a/" * 9 + "b", "."]
)
def test_a_name_that_leads_out_is_refused_and_nothing_is_left(client: TestClient, service: Service, name: str) -> None:
    refused = sent(client, {"good.csv": b"1", name: b"2"})
    assert (refused.status_code, refused.json()["code"]) == (422, "refused")
    assert "give a relative one" in refused.json()["detail"] and left(service) == []


def test_a_name_that_comes_twice_is_refused(client: TestClient, service: Service) -> None:
    files = [("file", ("a.csv", b"1")), ("file", ("a.csv", b"2"))]
    assert client.post(ROUTE, files=files).json()["detail"].startswith("a.csv: came twice")
    assert sent(client, {"a": b"1", "a/b": b"2"}).status_code == 422
    assert left(service) == []


@pytest.mark.parametrize(
    ("kind", "body", "status", "code"),
    [
        ("multipart/form-data; boundary=x", b'--x\r\nContent-Disposition: form-data; filename="a"\r\n\r\nab', 400,
         "multipart"),
        ("multipart/form-data; boundary=x", b"no part at all", 400, "multipart"),
        ("multipart/form-data; boundary=x", b'--x\r\nContent-Disposition: form-data; name="n"\r\n\r\nv\r\n--x--\r\n',
         422, "no-files"),
        ("multipart/form-data", b"--x--", 415, "multipart"),
        ("application/json", b"{}", 415, "multipart"),
        ("", b"x", 415, "multipart"),
    ],
)  # fmt: skip
def test_a_body_that_is_cut_or_none_is_refused_and_nothing_is_left(
    client: TestClient, service: Service, kind: str, body: bytes, status: int, code: str
) -> None:
    refused = client.post(ROUTE, content=body, headers={"Content-Type": kind})
    assert (refused.status_code, refused.json()["code"]) == (status, code)
    assert left(service) == []


def test_more_than_is_allowed_is_refused_also_where_its_size_is_not_stated(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    stated = client.post(ROUTE, content=b"x", headers={"Content-Length": str(2_000_000_001)})
    assert (stated.status_code, stated.json()["code"]) == (413, "too-large")
    monkeypatch.setattr(uploads, "MOST_FILES", 1)
    assert sent(client, {"a": b"1", "b": b"2"}).json()["detail"].startswith("more than 1 files")
    assert left(service) == []


def test_the_room_that_recordings_need_is_left(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "LEFT_FREE_BYTES", 10**18)
    refused = sent(client, {"a": b"1"})
    assert (refused.status_code, refused.json()["code"]) == (507, "disk-full")
    assert left(service) == []


def test_a_sender_that_falls_silent_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads, "SILENT_S", 0.05)

    async def pieces() -> AsyncIterator[bytes]:
        yield b'--x\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\nab'
        await asyncio.sleep(10)

    with pytest.raises(RequestRefused, match="nothing came for") as refused:
        asyncio.run(UploadShelf(tmp_path / "u").receive("multipart/form-data; boundary=x", 0, pieces()))
    assert refused.value.status == 408 and list((tmp_path / "u").iterdir()) == []


def test_who_may_only_look_sends_nothing(client: TestClient) -> None:
    assert client.post(ROUTE, content=b"", headers=bearer(Scope.READ)).status_code == 403


def test_what_is_older_than_a_week_goes(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    first = sent(client, {"a": b"1"}).json()["id"]
    sent(client, {"a": b"1"})
    assert client.get(f"{ROUTE}/{first}").status_code == 200
    monkeypatch.setattr(uploads, "KEPT_S", -1.0)
    sent(client, {"a": b"1"})
    assert client.get(f"{ROUTE}/{first}").status_code == 404


def test_an_upload_becomes_a_session(client: TestClient, tmp_path: Path) -> None:
    folder = measured(tmp_path / "measured")
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    upload = sent(client, files).json()["id"]
    done = ended(client, begun(client, "import", upload=upload, session="new"))
    assert done["state"] == "succeeded", done["message"]
    assert (done["session"], done["result"]["session"]) == ("new", str(tmp_path / "sessions" / "new"))
    assert any(file["name"].endswith(".mcap") for file in done["files"])
