"""Lists that lie in memory or in a folder: turned page by page, and asked by query, as those of the catalogue are."""

import os
import shutil
import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from argon2 import PasswordHasher
from fastapi.testclient import TestClient
from pydantic import BaseModel

from api.catalogue.pages import Page
from api.http.access.accounts import AccountStore
from api.http.access.audit import AuditLog
from api.http.access.scopes import Caller, Scope
from api.http.access.tokens import TokenStore
from api.http.listing import listing
from api.http.service import Service
from api.http.uploads import UploadShelf, UploadView
from mock_devices.testing.access import client_of
from rig.config.calibration import AxisCalibration, AxisStep, Calibration
from rig.config.calibration_files import text_of
from rig.config.wiring import Wiring
from rig.errors import UsageError

API = "/api/v1"
NAMES = ("ann", "ben", "eve")
SCOPES = (Scope.READ, Scope.ADMIN, Scope.READ)
# Names that no code of letters has, that end a line, or that are as long as a file system lets them be.
ODD = ("a\u2028b", "\N{GRINNING FACE}" * 62, "ü" * 125)
UPLOADS = {f"00000000000{number}": (name, number) for number, name in enumerate(("b.csv", "a.csv", "b.csv"))}
TOLD = (("Ann", "POST /a", "200"), ("Ben", "POST /b", "403 scope"), ("Ann", "POST /b", "200"))


def axis(serial: str, day: int) -> AxisCalibration:
    return AxisCalibration(
        product="an axis", serial=serial, date=datetime(2026, 1, day, tzinfo=UTC), scale=1.0, uncertainty=0.001,
        direction=1, direction_known_by="operator", increments_per_mm=1000.0, reference="gauge block",
        steps=(AxisStep(axis_mm=0.0, reference_mm=0.0), AxisStep(axis_mm=10.0, reference_mm=10.0)),
    )  # fmt: skip


def lay_down(root: Path, service: Service) -> None:
    """Three entries or more of each list."""
    access = root / "access"
    service.access.tokens, service.access.accounts = TokenStore(access), AccountStore(access, PasswordHasher(1, 8, 1))
    service.access.audit = AuditLog(root / "audit.jsonl")
    for name, scope in zip(NAMES, SCOPES, strict=True):
        service.access.tokens.create(name, scope)
        service.access.accounts.set(name, scope, "long enough for a password")
    for who, what, outcome in TOLD:
        service.access.audit.add(Caller(who, Scope.OPERATE, "1", "token"), what, outcome)
    for name in (*NAMES, *ODD):
        (root / f"{name}.toml").write_text(f'kind = "indentation"\ndepth_mm = {500 if name == "ben" else 5}\n')
    for serial, day in (("1", 1), ("2", 3), ("3", 3), ("4", 2)):
        (root / "calibration" / f"axis-{serial}.json").write_text(text_of(axis(serial, day)))
    for identifier, (name, day) in UPLOADS.items():
        folder = service.jobs.uploads / identifier
        folder.mkdir(parents=True)
        (folder / name).write_text("1,2")
        os.utime(folder, (86_400.0 * day,) * 2)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    root = tmp_path_factory.mktemp("lab")
    (root / "calibration").mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        used = Calibration(axis=Path("calibration/axis-1.json"), of_axis=axis("1", 1))
        service = Service(Wiring(calibration=used), root / "sessions", root)
        lay_down(root, service)
        with client_of(service) as found:
            found.headers["Authorization"] = f"Bearer {service.access.tokens.create('zoe', Scope.ADMIN).secret}"
            yield found


def walked(client: TestClient, path: str, limit: int) -> list[Any]:
    found = list[Any]()
    cursor: str | None = ""
    while cursor is not None:
        page = client.get(f"{API}{path}", params={"limit": limit, "cursor": cursor})
        assert page.status_code == 200, page.text
        assert 0 < len(page.json()["items"]) <= limit
        found += page.json()["items"]
        cursor = page.json()["next"]
    return found


ORDER = {
    "/tokens": ("name", {*NAMES, "zoe"}),
    "/accounts": ("name", [*NAMES]),
    "/audit": ("what", ["POST /b", "POST /b", "POST /a"]),
    "/protocols": ("name", sorted([*NAMES, *ODD])),
    "/calibrations": ("serial", ["1", "3", "2", "4"]),
    "/uploads": ("id", [*UPLOADS][::-1]),
}


@pytest.mark.parametrize("limit", [1, 2, 500])
@pytest.mark.parametrize("path", ORDER)
def test_pages_hold_every_entry_once_and_in_order(client: TestClient, path: str, limit: int) -> None:
    name, order = ORDER[path]
    found = [entry[name] for entry in walked(client, path, limit)]
    # Tokens made within one second have no order but that of their ids.
    assert (sorted(found) if isinstance(order, set) else found) == (sorted(order) if isinstance(order, set) else order)


@pytest.mark.parametrize("limit", [1, 7, 500])
def test_streams_keep_the_order_in_which_a_wrong_name_is_answered_with_them(client: TestClient, limit: int) -> None:
    there = client.get(f"{API}/streams/none/latest").json()["detail"].partition("there are ")[2].split(", ")
    assert [one["name"] for one in walked(client, "/streams", limit)] == there and len(there) > 7


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("/tokens?name=ben", ["ben"]),
        ("/tokens?scope=operate", []),
        ("/accounts?scope=read", ["ann", "eve"]),
        ("/accounts?name=eve&scope=admin", []),
        ("/protocols?name=ann", ["ann"]),
        ("/protocols?refused=true", ["ben"]),
        ("/protocols?refused=false&name=ben", []),
        ("/streams?name=force", ["force"]),
        ("/streams?unit=N&topic=force", ["force", "compression", "force.fx_N", "force.fy_N", "force.fz_N"]),
    ],
)
def test_a_list_is_asked_by_query(client: TestClient, path: str, found: list[str]) -> None:
    answer = client.get(f"{API}{path}").json()
    assert ([one["name"] for one in answer["items"]], answer["next"]) == (found, None)


@pytest.mark.parametrize(
    ("path", "key", "found"),
    [
        ("/calibrations?used=true", "serial", ["1"]),
        ("/calibrations?used=false&serial=4", "serial", ["4"]),
        ("/calibrations?what=force", "serial", []),
        ("/calibrations?product=another", "serial", []),
        ("/uploads?file=b.csv", "id", ["000000000002", "000000000000"]),
        ("/uploads?file=b", "id", []),
        ("/audit?who=Ann", "seq", [3, 1]),
        ("/audit?what=POST%20/b&outcome=200", "seq", [3]),
        ("/audit?outcome=403%20scope", "who", ["Ben"]),
    ],
)
def test_other_lists_by_what_their_entries_have(client: TestClient, path: str, key: str, found: list[object]) -> None:
    assert [one[key] for one in client.get(f"{API}{path}").json()["items"]] == found


def test_a_page_of_a_query_goes_on_with_that_query(client: TestClient) -> None:
    first = client.get(f"{API}/uploads?file=b.csv&limit=1").json()
    rest = client.get(f"{API}/uploads?file=b.csv&limit=1&cursor={first['next']}").json()
    assert [one["id"] for one in (*first["items"], *rest["items"])] == ["000000000002", "000000000000"]
    assert rest["next"] is None


@pytest.mark.parametrize("path", ["/tokens?scope=all", "/calibrations?what=x", "/calibrations?used=maybe"])
def test_what_no_entry_can_be_is_a_problem(client: TestClient, path: str) -> None:
    assert client.get(f"{API}{path}").json()["code"] == "invalid-request"


class Entry(BaseModel):
    """Of a list that nobody serves."""

    name: str
    good: bool = False
    tags: list[str] = []


ENTRIES = [Entry(name="b", good=True), Entry(name="a"), Entry(name="c", tags=["x"])]


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        ({}, "abc"), ({"name": "", "good": None}, "abc"), ({"good": False}, "ac"), ({"good": True}, "b"),
        ({"good": True, "name": "a"}, ""),
    ],
)  # fmt: skip
def test_no_is_asked_for_and_nothing_is_not(wanted: dict[str, str | bool | None], found: str) -> None:
    listed = listing("entries", ENTRIES, Page(), lambda one: (one.name, ""), newest_first=False, **wanted)
    assert "".join(one.name for one in listed.items) == found


def test_a_cursor_of_another_list_is_refused() -> None:
    following = listing("entries", ENTRIES, Page(1), lambda one: (one.name, "")).next
    assert following
    with pytest.raises(UsageError, match="none that was given by this list"):
        listing("others", ENTRIES, Page(1, following), lambda one: (one.name, ""))


def test_a_file_whose_name_is_no_text_hides_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("calibration").mkdir()
    for name in (b"good.toml", b"\xff.toml", b"\xfe.toml"):
        Path(os.fsdecode(name)).write_text('kind = "indentation"\n')
    for name in (b"axis-1.json", b"axis-\xff.json"):
        (Path("calibration") / os.fsdecode(name)).write_text(text_of(axis("1", 1)))
    client = client_of(Service(Wiring(), tmp_path / "sessions", tmp_path))
    listed = client.get(f"{API}/protocols")
    assert (listed.status_code, [one["name"] for one in listed.json()["items"]]) == (200, ["?", "?", "good"])
    assert [one["file"] for one in client.get(f"{API}/calibrations").json()["items"]] == [
        "calibration/axis-?.json", "calibration/axis-1.json"
    ]  # fmt: skip


def test_a_pipe_among_calibrations_is_listed_as_none_and_holds_nobody_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("calibration").mkdir()
    pipe = tmp_path / "calibration" / "axis-1.json"
    os.mkfifo(pipe)
    # Nothing comes out of it: a request that reads it is let go, and has read nothing.
    let_go = threading.Timer(5.0, lambda: os.close(os.open(pipe, os.O_RDWR)))
    let_go.start()
    Path("calibration/force-1.json").symlink_to("/dev/null")
    (tmp_path / "calibration" / "axis-2.json").write_text(text_of(axis("2", 1)))
    listed = client_of(Service(Wiring(), tmp_path / "sessions", tmp_path)).get(f"{API}/calibrations").json()["items"]
    let_go.cancel()
    assert {one["file"]: one["refused"].endswith("is no file") for one in listed} == {
        "calibration/axis-1.json": True, "calibration/force-1.json": True, "calibration/axis-2.json": False
    }  # fmt: skip


def test_an_upload_that_is_removed_while_they_are_listed_hides_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = Service(Wiring(), tmp_path / "sessions", tmp_path)
    client = client_of(service)
    kept, gone = (client.post(f"{API}/uploads", files=[("file", ("a", b"1"))]).json()["id"] for _ in range(2))
    plain = UploadShelf.view

    def going(shelf: UploadShelf, identifier: str) -> UploadView:
        shutil.rmtree(service.jobs.uploads / gone, ignore_errors=True)
        return plain(shelf, identifier)

    monkeypatch.setattr(UploadShelf, "view", going)
    assert [one["id"] for one in client.get(f"{API}/uploads").json()["items"]] == [kept]
