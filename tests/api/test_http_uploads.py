"""Files are sent in parts, written whole or not at all, and imported from there."""

import asyncio
import time
from base64 import b64decode
from collections.abc import AsyncIterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi import Request
from fastapi.testclient import TestClient

from api.http import room, uploads
from api.http.access.scopes import Scope
from api.http.answers import ANSWERS, read_answers
from api.http.jobs.kinds import KINDS
from api.http.jobs.params import ProposeParams
from api.http.problems import RequestRefused
from api.http.service import Service
from api.http.uploads import UploadShelf
from controller.operation import Operation
from mock_devices.testing.access import bearer, client_of
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring
from tests.api.jobs.asked import begun, ended
from tests.rig.recording.measured import measured

ROUTE = "/api/v1/uploads"
# A whole body of one file, with the rest of a header and further ones.
PART = b'--x\r\nContent-Disposition: form-data; filename="a"; of=%b\r\n%b\r\nab\r\n--x--\r\n'


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
    assert client.get(ROUTE).json() == {"items": [{**found, "left_out": []}], "next": None}


def test_an_upload_is_removed_in_two_steps(client: TestClient, service: Service) -> None:
    place = f"{ROUTE}/{sent(client, {'Ann Example.csv': b'1,2'}).json()['id']}"
    answers = service.jobs.folder / ANSWERS
    assert any(b"Ann Example" in b64decode(each.body) for each in read_answers(answers).values())
    asked = client.delete(place)
    assert (asked.status_code, asked.json()["done"], asked.json()["bytes"]) == (202, False, 3)
    wrong = client.delete(f"{place}?confirm=nonsense")
    assert (wrong.status_code, wrong.json()["code"]) == (409, "stale")
    (next(service.jobs.uploads.iterdir()) / "more.csv").write_text("something came meanwhile")
    late = client.delete(f"{place}?confirm={asked.json()['confirm']}")
    assert late.status_code == 409 and client.get(place).status_code == 200
    done = client.delete(f"{place}?confirm={client.delete(place).json()['confirm']}")
    assert (done.status_code, done.json()["done"], done.json()["confirm"]) == (200, True, "")
    assert client.delete(place).status_code == client.get(place).status_code == 404 and left(service) == []
    assert not any(b"Ann Example" in b64decode(each.body) for each in read_answers(answers).values())


def test_an_upload_that_is_worked_on_is_not_removed(client: TestClient, service: Service) -> None:
    upload = sent(client, {"a.csv": b"1,2"}).json()["id"]
    job = service.jobs.new(KINDS["propose"], ProposeParams(upload=upload), "Ann", None, Operation("propose"))
    service.jobs._enter(job)
    refused = client.delete(f"{ROUTE}/{upload}")
    assert (refused.status_code, refused.json()["code"], left(service)) == (409, "busy", [upload])


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
        pytest.param("multipart/form-data; boundary=x", PART % (b"a" * 100_000, b""), 400, "multipart", id="long"),
        pytest.param("multipart/form-data; boundary=x", PART % (b"a", b"X: 1\r\n" * 100), 400, "multipart", id="many"),
        ("multipart/form-data", b"--x--", 415, "multipart"),
        ("application/json", b"{}", 415, "multipart"),
        ("", b"x", 415, "multipart"),
    ],
)  # fmt: skip
def test_a_body_that_is_cut_endless_or_none_is_refused_and_nothing_is_left(
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
    monkeypatch.setattr(room, "LEFT_FREE_BYTES", 10**18)
    refused = sent(client, {"a": b"1"})
    assert (refused.status_code, refused.json()["code"]) == (507, "disk-full")
    assert left(service) == []


def test_an_upload_ends_before_the_disk_is_full_and_nothing_of_it_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody else fills the disk while it comes, or its size was not stated."""
    root, seen = tmp_path / "uploads", list[int]()

    def filling(_: Path) -> SimpleNamespace:
        seen.append(sum(path.stat().st_size for path in root.rglob("*") if path.is_file()))
        return SimpleNamespace(free=room.LEFT_FREE_BYTES + 5 * uploads.WRITTEN_BYTES - 2 * seen[-1] - 1)

    monkeypatch.setattr("shutil.disk_usage", filling)

    async def pieces() -> AsyncIterator[bytes]:
        yield b'--x\r\nContent-Disposition: form-data; name="file"; filename="a.bin"\r\n\r\n'
        for _ in range(4):
            yield bytes(uploads.WRITTEN_BYTES)
        yield b"\r\n--x--\r\n"

    with pytest.raises(RequestRefused, match="remove what is not needed") as refused:
        asyncio.run(UploadShelf(root).receive("multipart/form-data; boundary=x", 0, pieces()))
    assert (refused.value.status, refused.value.code) == (507, "disk-full")
    assert max(seen) == 2 * uploads.WRITTEN_BYTES and list(root.iterdir()) == []


def test_an_import_that_would_fill_the_disk_does_not_begin(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload = sent(client, {"a.csv": bytes(1000)}).json()["id"]
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=room.LEFT_FREE_BYTES + 3999))
    asked = {"kind": "import", "params": {"upload": upload, "session": "measured", "usual": True}}
    refused = client.post("/api/v1/jobs", json=asked)
    assert (refused.status_code, refused.json()["code"]) == (507, "disk-full")
    assert client.get("/api/v1/jobs").json()["items"] == [] and not (service.sessions / "measured").exists()


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
    assert client.get(f"{ROUTE}/{first}").status_code == 200, "one of those that came last"
    monkeypatch.setattr(uploads, "NEWEST_KEPT", 1)
    sent(client, {"a": b"1"})
    assert client.get(f"{ROUTE}/{first}").status_code == 404


BODY = b'--x\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\nab\r\n--x--\r\n'
YEAR_S = 365 * 24 * 3600.0


async def whole() -> AsyncIterator[bytes]:
    yield BODY


async def put(shelf: UploadShelf, pieces: AsyncIterator[bytes] | None = None) -> str:
    return (await shelf.receive("multipart/form-data; boundary=x", 0, pieces or whole())).id


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Age alone decides of all but the newest."""
    monkeypatch.setattr(uploads, "NEWEST_KEPT", 1)


@pytest.mark.usefixtures("few")
def test_a_clock_that_was_set_forward_takes_no_upload(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shelf, real = UploadShelf(tmp_path / "u"), time.time
    first = asyncio.run(put(shelf))
    monkeypatch.setattr(time, "time", lambda: real() + YEAR_S)
    others = [asyncio.run(put(shelf)) for _ in range(2)]
    assert {one.id for one in shelf.listed()} == {first, *others}


@pytest.mark.usefixtures("few")
def test_a_clock_that_was_set_back_makes_no_new_upload_old(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shelf = UploadShelf(tmp_path / "u")
    # The system stamps what is made now as a year old.
    monkeypatch.setattr(shelf, "_now_s", lambda: time.time() + YEAR_S)
    made = [asyncio.run(put(shelf)) for _ in range(3)]
    assert {one.id for one in shelf.listed()} == set(made)


@pytest.mark.usefixtures("few")
def test_what_is_worked_on_or_just_comes_stays_however_old_it_seems(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "KEPT_S", -1.0)
    used = list[str]()
    shelf = UploadShelf(tmp_path / "u", lambda identifier: identifier in used)
    used.append(asyncio.run(put(shelf)))

    async def slow() -> AsyncIterator[bytes]:
        head, end = BODY.split(b"ab")
        yield head + b"a" * uploads.WRITTEN_BYTES  # so much that it is written at once
        for _ in range(3):
            await put(shelf)
        yield end

    late = asyncio.run(put(shelf, slow()))
    assert {used[0], late} <= {one.id for one in shelf.listed()}


def test_an_upload_becomes_a_session(client: TestClient, tmp_path: Path) -> None:
    folder = measured(tmp_path / "measured")
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    upload = sent(client, files).json()["id"]
    done = ended(client, begun(client, "import", upload=upload, session="new"))
    assert done["state"] == "succeeded", done["message"]
    assert (done["session"], done["result"]["session"]) == ("new", str(tmp_path / "sessions" / "new"))
    assert any(file["name"].endswith(".mcap") for file in done["files"])


def keyed(client: TestClient, content: bytes, key: str = "k") -> Any:
    return client.post(ROUTE, files=[("file", ("a.csv", content))], headers={"Idempotency-Key": key})


def test_an_upload_with_a_key_is_read_piece_by_piece_too(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """A key let the whole body into memory, past every limit of an upload."""

    async def whole(_: Request) -> bytes:
        raise AssertionError("the body was read whole")

    monkeypatch.setattr(Request, "body", whole)
    first = keyed(client, b"1,2\n" * 1000)
    assert first.status_code == 201, first.text
    assert keyed(client, b"1,2\n" * 1000).json() == first.json()
    other = keyed(client, b"1,2\n" * 1001)
    assert (other.status_code, other.json()["code"]) == (422, "idempotency-key-reused")
    assert len(client.get(ROUTE).json()["items"]) == 1
