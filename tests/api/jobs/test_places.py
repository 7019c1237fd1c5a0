"""No name and no link leads a job out of the data folder."""

import os
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.jobs.places import PlaceRefused, Places, regular_file
from tests.api.jobs.asked import begun, ended

OUT = ("..", "../first", "first/../first", "/etc", ".hidden", "a\0b", "first/fit", "")


@pytest.fixture
def places(tmp_path: Path) -> Places:
    (tmp_path / "sessions" / "first" / "fit").mkdir(parents=True)
    (tmp_path / "sessions" / ".hidden").mkdir()
    return Places(tmp_path / "sessions", tmp_path / "protocols", tmp_path / "uploads", tmp_path / "files")


@pytest.mark.parametrize("name", OUT)
def test_a_name_that_is_no_session_of_the_folder_is_refused(places: Places, name: str) -> None:
    with pytest.raises(PlaceRefused, match="no session") as refused:
        places.session(name)
    assert refused.value.status == 404


@pytest.mark.parametrize("name", ["S 01 Müller", "a'b", "100%", "-x", "ä"])
def test_sessions_made_elsewhere_may_have_any_name(places: Places, name: str) -> None:
    (places.sessions / name).mkdir()
    assert places.session(name) == places.sessions / name
    with pytest.raises(PlaceRefused):
        places.new_session(name)


def test_links_are_refused_wherever_they_are(places: Places, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (places.sessions / "linked").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(PlaceRefused, match="no session"):
        places.session("linked")
    with pytest.raises(PlaceRefused, match="exists"):
        places.new_session("linked")
    (places.sessions / "first" / "fit" / "model.json").symlink_to("/etc/passwd")
    with pytest.raises(PlaceRefused, match=r"first/fit/model\.json is a link") as refused:
        places.session("first")
    assert (refused.value.status, refused.value.code) == (409, "link")


@pytest.mark.parametrize("path", ["../secret", "fit/../../secret", "/etc/passwd", "", ".", "fit", "fit/", "a//b"])
def test_only_regular_files_below_a_folder_are_served(tmp_path: Path, path: str) -> None:
    (tmp_path / "first" / "fit").mkdir(parents=True)
    (tmp_path / "secret").write_text("secret")
    assert regular_file(tmp_path / "first", path) is None


def test_a_link_on_the_way_to_a_file_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "first").mkdir()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "file").write_text("x")
    (tmp_path / "first" / "way").symlink_to(tmp_path / "other")
    (tmp_path / "first" / "file").symlink_to(tmp_path / "other" / "file")
    assert regular_file(tmp_path / "first", "way/file") is None
    assert regular_file(tmp_path / "first", "file") is None
    assert regular_file(tmp_path / "other", "file") == tmp_path / "other" / "file"


@pytest.mark.parametrize(
    ("kind", "params", "status", "code"),
    [
        ("fit", {"sessions": ["nobody"]}, 404, "no-such-session"),
        ("fit", {"sessions": ["../sessions/first"]}, 404, "no-such-session"),
        ("fit", {"sessions": ["first"], "extended": {"session": "first", "file": "diagnosis"}}, 404, "no-such-model"),
        ("simulate", {"model": {"session": "first"}, "reference": "step:5"}, 404, "no-such-model"),
        ("import", {"upload": "0a1b2c3d4e5f", "session": "new"}, 404, "no-such-upload"),
        ("protocol-check", {"protocol": "none"}, 404, "no-such-protocol"),
        ("verify", {"session": "first", "recording": "../../secret"}, 404, "no-such-recording"),
        ("repair", {"session": "first", "recording": "none"}, 404, "no-such-recording"),
    ],
)
def test_what_is_not_there_is_told_before_a_job_begins(
    client: TestClient, first: Path, kind: str, params: dict[str, object], status: int, code: str
) -> None:
    answer = client.post("/api/v1/jobs", json={"kind": kind, "params": params})
    assert (answer.status_code, answer.json()["code"]) == (status, code)
    assert client.get("/api/v1/jobs").json()["items"] == []


def test_a_session_of_any_name_is_worked_on(client: TestClient, first: Path) -> None:
    name = "S 01 – Müller's 100 %"
    first.rename(first.with_name(name))
    done = ended(client, begun(client, "report", session=name))
    assert done["state"] == "succeeded", done["message"]
    assert client.get(done["files"][0]["href"]).status_code == 200
    assert os.sep + name in done["result"]["session"]
