"""What the catalogue lists is what the folders hold, in SQLite and PostgreSQL alike, whatever becomes of them."""

import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from api.catalogue import catalogue, queries
from api.catalogue.catalogue import Catalogue
from api.catalogue.database import Database
from api.catalogue.pages import Page
from api.catalogue.queries import Asked
from rig.errors import UsageError
from tests.api.catalogue.made import diagnosed, fitted, make_session, trial, with_threshold


def listed(catalogue: Catalogue, **asked: str) -> list[str]:
    return [session.session for session in catalogue.sessions(Asked(**asked)).items]


@pytest.fixture
def lab(root: Path, database: str) -> Catalogue:
    """Three sessions of two subjects at two sites."""
    diagnosed(fitted(make_session(root, "a", created="2026-11-20T10:00:00+00:00")), "friction", "hysteresis")
    with_threshold(make_session(root, "b", created="2026-11-21T00:30:00+01:00"), 7.4)
    bad = (trial(1, "bad"), trial(1, repeats="trial_001"), trial(2, "usable"))
    make_session(root, "c", {"id": "S02", "site": "calf"}, created="2026-11-21T10:00:00", trials=bad)
    return Catalogue(root, database)


def test_a_session_is_listed_as_its_folder_tells_it(lab: Catalogue) -> None:
    session = lab.sessions(Asked(session="c")).items[0]
    assert (session.subject, session.site, session.kind, session.protocol) == ("S02", "calf", "capture", "indentation")
    assert (session.trials, session.samples, session.dropped) == (3, 4500, 1)
    assert session.quality == "usable"  # the bad trial was made again
    assert session.remarks == ()


def test_sessions_come_newest_first_by_one_clock(lab: Catalogue) -> None:
    assert listed(lab) == ["c", "b", "a"]
    assert [session.at for session in lab.sessions().items] == [
        "2026-11-21T10:00:00.000000Z",
        "2026-11-20T23:30:00.000000Z",
        "2026-11-20T10:00:00.000000Z",
    ]


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        ({"subject": "S01"}, ["b", "a"]),
        ({"site": "calf"}, ["c"]),
        ({"quality": "good"}, ["b", "a"]),
        ({"kind": "import"}, []),
        ({"subject": "S01", "site": "calf"}, []),
        ({"cause": "hysteresis"}, ["a"]),
        ({"since": "2026-11-21"}, ["c"]),
        ({"until": "2026-11-20"}, ["b", "a"]),
        ({"since": "2026-11-21T00:30:00+01:00", "until": "2026-11-20T23:30:00Z"}, ["b"]),
    ],
)
def test_sessions_are_asked_for_by_what_they_are(lab: Catalogue, asked: dict[str, str], found: list[str]) -> None:
    assert listed(lab, **asked) == found


@pytest.mark.parametrize("given", ["yesterday", "2026-13-01", "1e9999", "'; DROP TABLE rig_session; --"])
def test_a_date_that_is_none_is_said(lab: Catalogue, given: str) -> None:
    with pytest.raises(UsageError, match="is no date; write 2026-11-23"):
        lab.sessions(Asked(since=given))
    assert listed(lab) == ["c", "b", "a"]


def test_pages_follow_each_other_without_a_gap_while_sessions_are_added(lab: Catalogue) -> None:
    first = lab.sessions(page=Page(limit=2))
    assert [session.session for session in first.items] == ["c", "b"] and first.next
    make_session(lab.root, "d", created="2026-12-01T00:00:00Z")
    rest = lab.sessions(page=Page(limit=2, cursor=first.next))
    assert [session.session for session in rest.items] == ["a"] and rest.next is None


@pytest.mark.parametrize("cursor", ["x", "W10", "bnVsbA", "WzEsMl0", "WyJcdTAwMDAiLCJcdWQ4MDAiXQ", "é"])
def test_a_cursor_that_was_never_given_is_refused_or_finds_nothing_wrong(lab: Catalogue, cursor: str) -> None:
    try:
        found = lab.sessions(page=Page(cursor=cursor))
    except UsageError as error:
        assert "is none that was given" in str(error)
    else:
        assert {session.session for session in found.items} <= {"a", "b", "c"}


@pytest.mark.parametrize("limit", [0, -1, 501])
def test_a_page_has_bounds(lab: Catalogue, limit: int) -> None:
    with pytest.raises(UsageError, match="a page has 1 to 500 entries"):
        lab.sessions(page=Page(limit=limit))


def test_models_diagnoses_causes_trials_and_operations_are_asked_for(lab: Catalogue) -> None:
    (model,) = lab.models(Asked(law="index")).items
    assert (model.session, model.subject, model.file) == ("a", "S01", "fit/model.json")
    assert model.parameters["b_per_mm"] == pytest.approx(0.22, abs=0.1)
    assert lab.models(Asked(law="fung")).items == ()
    (diagnosis,) = lab.diagnoses(Asked(verdict="explained", cause="hysteresis")).items
    assert (diagnosis.statement, diagnosis.explained_share) == ("the simulation lacks friction", 0.8)
    assert lab.diagnoses(Asked(cause="drift")).items == ()
    assert {cause.name for cause in lab.causes().items} == {"friction", "hysteresis"}
    (bad,) = lab.trials(Asked(quality="bad")).items
    assert (bad.session, bad.name, bad.reasons) == ("c", "trial_001", ("force scatters by 0.3 N in the air",))
    assert bad.peak_force_N is None
    assert {work.kind for work in lab.operations(Asked(session="a")).items} == {"capture", "fit", "diagnose"}


def test_a_subject_s_history_has_sessions_thresholds_models_and_diagnoses(lab: Catalogue) -> None:
    history = lab.history("S01")
    assert (history.subject.sites, history.subject.sessions) == (("forearm",), 2)
    assert [session.session for session in history.sessions] == ["b", "a"]
    assert [(each.session, each.force_N) for each in history.thresholds] == [("b", 7.4)]
    assert [len(history.models), len(history.diagnoses)] == [1, 1]
    assert [each.subject for each in lab.subjects().items] == ["S01", "S02"]
    assert [each.subject for each in lab.subjects(Asked(site="calf")).items] == ["S02"]
    with pytest.raises(UsageError, match="subject 'S03': has no session"):
        lab.history("S03")


def test_new_changed_and_removed_folders_are_noticed(lab: Catalogue) -> None:
    assert listed(lab, subject="S01") == ["b", "a"]
    shutil.rmtree(lab.root / "a")
    make_session(lab.root, "d")
    shutil.rmtree(lab.root / "c")
    make_session(lab.root, "c", {"id": "S09"}, created="2026-11-21T10:00:00")
    with_threshold(lab.root / "b", None, "track_002")
    assert listed(lab) == ["c", "b", "d"]
    assert listed(lab, subject="S09") == ["c"]
    assert lab.models().items == () and lab.causes().items == ()
    assert [each.force_N for each in lab.history("S01").thresholds if each.recording == "track_002.mcap"] == [None]


def test_a_change_that_leaves_size_and_date_is_noticed(lab: Catalogue) -> None:
    file = lab.root / "b" / "session.json"
    listed(lab)
    before = file.stat()
    file.write_text(file.read_text().replace('"S01"', '"S77"'))
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert file.stat().st_size == before.st_size and file.stat().st_mtime_ns == before.st_mtime_ns
    assert listed(lab, subject="S77") == ["b"]


def test_a_list_is_put_together_once_until_folders_or_tables_change(
    lab: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed(lab)  # brings the tables to what the folders hold, which writes to them
    before, asked = lab.sessions(), 0

    def counted(*wanted: Any) -> Any:
        nonlocal asked
        asked += 1
        return queries.listed(*wanted)

    monkeypatch.setattr(catalogue, "listed", counted)
    assert [lab.sessions() for _ in range(3)] == 3 * [before]
    assert asked == (0 if lab.database.is_sqlite else 3)  # of a server nothing tells that it was written to
    assert lab.sessions(Asked(quality="bad")) != before
    after_another = asked
    lab.rename("S01", "Ann Example")
    assert lab.sessions() == before and asked == after_another + 1
    make_session(lab.root, "d")
    assert len(listed(lab)) == 4
    assert asked > after_another + 1


def test_of_a_server_a_list_is_asked_for_each_time(lab: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Database, "looks", None)
    before = lab.sessions()
    with lab.database.writing() as connection:
        connection.exec_driver_sql("DELETE FROM rig_session WHERE session = 'a'")
    assert len(lab.sessions().items) == len(before.items) - 1


def test_the_folder_of_all_sessions_may_go_and_come_back(lab: Catalogue) -> None:
    lab.rename("S01", "Ann Example")
    away = lab.root.rename(lab.root.with_name("elsewhere"))
    found = lab.sessions()
    assert found.items == () and "there is no such folder" in found.remarks[0]
    assert [each.name for each in lab.subjects().items] == ["Ann Example"]
    away.rename(lab.root)
    assert listed(lab) == ["c", "b", "a"]


def test_a_rebuild_gives_what_there_was_and_keeps_names(lab: Catalogue) -> None:
    lab.rename("S01", "Ann Example")
    before = lab.sessions(), lab.trials(), lab.models(), lab.diagnoses(), lab.causes(), lab.history("S01")
    result = lab.rebuild()
    assert (result.sessions, result.subjects, result.names) == (3, 2, 1)
    assert before == (lab.sessions(), lab.trials(), lab.models(), lab.diagnoses(), lab.causes(), lab.history("S01"))


def test_a_rebuild_mends_what_somebody_changed_in_the_tables(lab: Catalogue) -> None:
    listed(lab)
    with lab.database.writing() as connection:
        connection.exec_driver_sql("UPDATE rig_session SET subject = 'S99'")
    assert listed(lab, subject="S01") == []
    lab.rebuild()
    assert listed(lab, subject="S01") == ["b", "a"]
