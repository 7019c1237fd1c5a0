"""Folders as they should not be: links, any name, broken lists, wrong clocks, removed while they are read."""

import json
import os
import shutil
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest
from sqlalchemy import event

from api.catalogue import folder as reading
from api.catalogue import refresh
from api.catalogue.catalogue import Catalogue
from api.catalogue.folder import LONGEST, short, stamp, utc, utc_of
from api.catalogue.queries import Asked
from mock_devices.testing.made.synthetic import Bench, write_made_session
from rig.results.catalogue import SessionEntry
from tests.api.catalogue.made import diagnosed, fitted, make_session, trial, with_threshold

NOW_S = datetime(2026, 11, 23, tzinfo=UTC).timestamp()


@pytest.fixture
def lab(root: Path, tmp_path: Path) -> Catalogue:
    return Catalogue(root, str(tmp_path / "catalogue.sqlite"), now_s=lambda: NOW_S)


def only(lab: Catalogue) -> SessionEntry:
    (found,) = lab.sessions().items
    return found


def test_a_folder_that_is_a_link_is_not_followed_and_that_is_said(lab: Catalogue, tmp_path: Path) -> None:
    outside = make_session(tmp_path / "outside", "secret")
    (lab.root / "linked").symlink_to(outside)
    (lab.root / "up").symlink_to("..")
    (lab.root / "dangling").symlink_to(tmp_path / "nothing")
    (lab.root / "loop").symlink_to("loop")
    found = lab.sessions()
    assert found.items == ()
    assert [each.partition(":")[0] for each in found.remarks] == ["dangling", "linked", "loop", "up"]
    assert "is a link, which is not followed; put the folder itself there" in found.remarks[1]


@pytest.mark.parametrize("name", ["session.json", "fit", "fit/model.json", "trial_001.mcap"])
def test_a_link_inside_a_session_is_not_read(lab: Catalogue, tmp_path: Path, name: str) -> None:
    outside = fitted(make_session(tmp_path / "outside", "other", {"id": "SECRET", "site": "x"}))
    inside = fitted(make_session(lab.root, "a"))
    place = inside / name
    shutil.rmtree(place) if place.is_dir() else place.unlink()
    place.symlink_to(outside / name)
    session = only(lab)
    assert session.subject != "SECRET"
    assert len(lab.models().items) == (0 if name.startswith("fit") else 1)
    if name != "trial_001.mcap":  # only its name and size are listed
        assert any("is a link, which is not followed" in remark for remark in session.remarks)


def test_recordings_that_are_links_are_not_opened_in_place_of_a_missing_list(lab: Catalogue, tmp_path: Path) -> None:
    made = write_made_session(tmp_path / "outside", Bench(rate_Hz=500.0).cycles(trials=1, speeds_mm_s=(20.0,)))
    inside = lab.root / "a"
    inside.mkdir()
    for path in made.glob("*.mcap"):
        (inside / path.name).symlink_to(path)
    session = only(lab)
    assert (session.kind, session.trials) == ("unknown", 0)
    assert "recordings are links, which are not followed; put the files themselves there" in session.remarks


def test_a_link_that_would_be_followed_would_be_seen(
    lab: Catalogue, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The plant: a scan that takes links for folders."""
    (lab.root / "linked").symlink_to(make_session(tmp_path / "outside", "secret"))
    monkeypatch.setattr(refresh, "_refusal", lambda _: "")
    monkeypatch.setattr(refresh, "_is_folder", lambda item: item.is_dir())
    assert [session.session for session in lab.sessions().items] == ["linked"]


def test_a_name_that_is_no_text_is_said_and_hides_no_other(lab: Catalogue) -> None:
    make_session(lab.root, "good")
    (lab.root / os.fsdecode(b"bad\xff\xfe")).mkdir()
    found = lab.sessions()
    assert [session.session for session in found.items] == ["good"]
    assert found.remarks == (r"bad\xff\xfe: its name is no UTF-8, so it cannot be listed; rename it",)
    assert json.loads(found.model_dump_json())


def test_a_path_as_a_code_or_a_trial_s_name_leads_nowhere(lab: Catalogue) -> None:
    make_session(lab.root, "a", {"id": "../../etc/passwd", "site": "/etc"})
    file = lab.root / "a" / "session.json"
    listed = json.loads(file.read_text())
    listed["trials"][0] |= {"name": "../b/" + "x" * 5000, "file": "../../../etc/passwd"}
    file.write_text(json.dumps(listed))
    assert lab.history("../../etc/passwd").subject.sessions == 1
    (found,) = lab.trials().items
    assert len(found.key) <= LONGEST


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        '{"id": 1}',
        "\0" * 100,
        "[" * 100_000,
        '{"trials": "' + "x" * 1_000_000,
        "\ud7ff",
        "é" * 9,
    ],
)
def test_a_list_that_cannot_be_read_is_a_remark_and_hides_no_other(lab: Catalogue, text: str) -> None:
    make_session(lab.root, "good")
    file = make_session(lab.root, "broken") / "session.json"
    file.write_text(text)
    good, broken = sorted(lab.sessions().items, key=lambda each: each.kind)
    assert (good.session, broken.session, broken.kind) == ("good", "broken", "unknown")
    assert "session.json cannot be read: the session is taken from its recordings" in broken.remarks


def test_a_session_without_its_list_is_read_from_its_recordings(lab: Catalogue) -> None:
    made = write_made_session(
        lab.root / "a",
        Bench(rate_Hz=500.0).cycles(trials=1, speeds_mm_s=(20.0,)),
        subject={"id": "S05", "site": "calf"},
    )
    before = only(lab)
    (made / "session.json").unlink()
    after = only(lab)
    assert (after.trials, after.kind) == (before.trials, before.kind)
    assert any("session.json is missing" in remark for remark in after.remarks)


@pytest.mark.parametrize("name", ["fit/model.json", "diagnosis/diagnosis.json", "track_001.threshold.json"])
@pytest.mark.parametrize("text", ["", "[]", '{"version": 99, "format": "tissue-rig model"}', "\udcff", "[" * 50_000])
def test_a_result_that_cannot_be_read_is_a_remark_with_its_name(lab: Catalogue, name: str, text: str) -> None:
    path = make_session(lab.root, "a") / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(text.encode(errors="surrogateescape"))
    assert any(remark.startswith(f"{name} cannot be listed: ") for remark in only(lab).remarks)


def test_a_session_from_the_future_is_listed_and_that_is_said(lab: Catalogue) -> None:
    make_session(lab.root, "later", created="2031-01-01T00:00:00+00:00")
    make_session(lab.root, "now", created="2026-11-23T00:00:59+00:00")
    later, now = lab.sessions().items
    assert (later.session, now.remarks) == ("later", ())
    assert later.remarks == (
        "its date, 2031-01-01T00:00:00.000000Z, has not come yet: this computer's clock or the one that wrote it was"
        " wrong",
    )


@pytest.mark.parametrize(
    "created", ["", "yesterday", "0000-00-00", "2026-11-20T25:00", "99999-01-01", "0001-01-01T00:00+14:00"]
)
def test_a_date_that_no_calendar_has_is_replaced_by_that_of_the_folder(lab: Catalogue, created: str) -> None:
    folder = make_session(lab.root, "a", created=created)
    os.utime(folder, (NOW_S - 60.0, NOW_S - 60.0))
    assert (only(lab).created, only(lab).at) == (created, "2026-11-22T23:59:00.000000Z")


@pytest.mark.parametrize("jump_s", [-1e9, -3600.0, -0.001, 0.001, 3600.0, 3e9])
def test_a_clock_that_jumps_hides_no_change(lab: Catalogue, jump_s: float) -> None:
    file = make_session(lab.root, "a") / "session.json"
    assert only(lab).subject == "S01"
    file.write_text(file.read_text().replace('"S01"', '"S88"'))
    os.utime(file, (NOW_S + jump_s, NOW_S + jump_s))
    assert only(lab).subject == "S88"


def test_a_stamp_that_asks_for_newer_files_would_miss_a_clock_that_went_back(
    lab: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The plant: what changed is what has a later date than all before."""
    latest: dict[str, float] = {}

    def newer(folder: Path) -> str:
        latest[folder.name] = max(latest.get(folder.name, 0.0), (folder / "session.json").stat().st_mtime)
        return str(latest[folder.name])

    monkeypatch.setattr(refresh, "stamp", newer)
    with pytest.raises(AssertionError):
        test_a_clock_that_jumps_hides_no_change(lab, -3600.0)


@pytest.mark.parametrize("seconds", [-1e20, 1e20, float("inf"), -6e10, 2.6e11])
def test_a_time_that_no_calendar_has_is_empty(seconds: float) -> None:
    assert utc(seconds) in ("", "1970-01-01T00:00:00.000000Z") or seconds == -6e10


def test_times_are_brought_to_one_form() -> None:
    assert utc_of("2026-11-23T12:00:00+02:00") == utc_of("2026-11-23T10:00") == "2026-11-23T10:00:00.000000Z"
    assert utc_of("2026-11-23") == "2026-11-23T00:00:00.000000Z"


def test_where_nothing_has_changed_a_list_opens_the_database_once(lab: Catalogue) -> None:
    make_session(lab.root, "a")
    lab.sessions()
    opened: list[object] = []
    event.listen(lab.database.engine, "connect", lambda connection, _: opened.append(connection))
    lab.sessions()
    assert len(opened) == 1
    make_session(lab.root, "b")
    assert len(lab.sessions().items) == 2
    assert len(opened) == 4, "looked at, brought up to date, and read"


def test_a_session_removed_while_it_is_read_is_not_listed(lab: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    fitted(make_session(lab.root, "a"))
    make_session(lab.root, "b")
    real = reading.read_folder

    def removed_first(folder: Path) -> object:
        if folder.name == "a":
            shutil.rmtree(folder)
        return real(folder)

    monkeypatch.setattr(refresh, "read_folder", removed_first)
    assert [session.session for session in lab.sessions().items] == ["b"]


def test_a_session_removed_between_its_list_and_its_results_leaves_no_error(
    lab: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    fitted(make_session(lab.root, "a"))
    real = reading._common

    def removed(folder: Path, info: object) -> object:
        found = real(folder, info)  # type: ignore[arg-type]
        shutil.rmtree(folder)
        return found

    monkeypatch.setattr(reading, "_common", removed)
    assert lab.models().items == ()
    assert [each.session for each in lab.sessions().items] in ([], ["a"])
    monkeypatch.undo()
    assert lab.sessions().items == ()


def test_folders_of_other_things_are_not_listed(lab: Catalogue) -> None:
    (lab.root / "notes").mkdir()
    (lab.root / "notes" / "text.txt").write_text("nothing")
    (lab.root / "file.mcap").write_text("a file")
    (lab.root / ".hidden").mkdir()
    make_session(lab.root, ".trash")
    assert lab.sessions().items == ()


def test_a_folder_that_nobody_may_read_hides_no_other(lab: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    make_session(lab.root, "a")
    make_session(lab.root, "b")
    real = stamp

    def refused(folder: Path) -> str:
        if folder.name == "a":
            raise PermissionError(13, "Permission denied", str(folder))
        return real(folder)

    monkeypatch.setattr(refresh, "stamp", refused)
    assert [session.session for session in lab.sessions().items] == ["b"]


def test_numbers_beyond_what_a_database_counts_are_held_at_its_end(lab: Catalogue) -> None:
    many = trial(1)
    many.samples["force"] = 10**30
    make_session(lab.root, "a", trials=(many,))
    assert only(lab).samples == 2**63 - 1
    assert lab.sessions(Asked(subject="S01")).items


def test_long_codes_are_told_apart_by_their_ends() -> None:
    one, other = short("x" * 5000 + "1"), short("x" * 5000 + "2")
    assert len(one) == len(other) <= LONGEST and one != other
    assert short("S01") == "S01"


def test_the_stamp_is_of_what_is_read_and_of_nothing_else(lab: Catalogue) -> None:
    folder = fitted(make_session(lab.root, "a"))
    before = stamp(folder)
    (folder / "exported.csv").write_text("1")
    assert stamp(folder) == before
    (folder / "fit" / "model.json").write_text("{}")
    assert stamp(folder) != before
    with pytest.raises(OSError):
        stamp(lab.root / "none")


def grown_beside(folder: Path) -> bool:
    """Whether a recording that grows in ``folder`` is a change."""
    before = reading.stamp(folder)
    with (folder / "trial_001.mcap").open("ab") as recording:
        recording.write(b"more of the same trial")
    return reading.stamp(folder) != before


def test_a_recording_that_grows_is_a_change_only_where_no_list_tells_of_it(
    lab: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_session(lab.root, "a", trials=(trial(1),))
    assert not grown_beside(folder)
    before = stamp(folder)
    (folder / "trial_002.mcap").write_bytes(b"begins")
    assert stamp(folder) != before
    before = stamp(folder)
    (folder / "trial_002.mcap").unlink()
    assert stamp(folder) != before
    # Planted: whatever has another size is read anew, at every question, while it is recorded.
    with monkeypatch.context() as planted:
        planted.setattr(reading, "stamp", lambda place: str([path.stat().st_size for path in place.glob("*.mcap")]))
        assert grown_beside(folder)
    (folder / "session.json").unlink()
    assert grown_beside(folder)


def opened(root: Path) -> list[str]:
    """What any part of this process opens below ``root`` from now on; the list grows."""
    found = list[str]()
    sys.addaudithook(lambda event, args: found.append(args[0]) if event == "open" and _below(args[0], root) else None)
    return found


def _below(name: object, root: Path) -> bool:
    return isinstance(name, str) and name.startswith(f"{root}/")


def test_a_question_opens_only_what_changed_and_never_a_recording(lab: Catalogue) -> None:
    for name in ("a", "b", "c"):
        with_threshold(diagnosed(fitted(make_session(lab.root, name)), "friction"), 7.25)
    seen = opened(lab.root)
    assert len(lab.sessions().items) == 3
    assert any(name.endswith("a/session.json") for name in seen)
    assert [name for name in seen if name.endswith(".mcap")] == []
    seen.clear()
    assert len(lab.sessions().items) == len(lab.models().items) == 3
    assert seen == []
    (lab.root / "b" / "new.mcap").write_bytes(b"not in the list yet")
    seen.clear()
    lab.sessions()
    assert {Path(name).relative_to(lab.root).parts[0] for name in seen} == {"b"}
    assert [name for name in seen if name.endswith(".mcap")] == []
