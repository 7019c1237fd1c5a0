"""A subject's data leave whole, and are erased in two steps that cannot be mixed up."""

import errno
import json
import os
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

from api.catalogue.catalogue import Catalogue
from api.catalogue.erasing import PREFIX, NotErased, left
from api.catalogue.subjects import erase_subject, export_subject
from rig.errors import UsageError
from tests.api.catalogue.made import fitted, make_session, with_threshold

NAME = "Ann Unmistakable-Example"
OTHER = {"id": "S02", "site": "calf"}


@pytest.fixture
def lab(root: Path, database: str) -> Catalogue:
    """Two sessions of S01, who has a name, and one of S02."""
    fitted(make_session(root, "a"))
    with_threshold(make_session(root, "b"), 6.5)
    make_session(root, "other", OTHER)
    found = Catalogue(root, database)
    found.rename("S01", NAME)
    return found


def test_an_archive_has_every_file_of_the_subject_and_no_other_s(lab: Catalogue, tmp_path: Path) -> None:
    odd = lab.root / "a" / "od\\d\nname"
    odd.write_bytes(os.urandom(3_000_000))
    done = export_subject(lab, "S01", tmp_path / "S01.zip")
    with zipfile.ZipFile(tmp_path / "S01.zip") as archive:
        assert archive.testzip() is None
        archive.extractall(tmp_path / "out")
    taken = {path.relative_to(tmp_path / "out" / "sessions") for path in (tmp_path / "out" / "sessions").rglob("*")}
    there = {path.relative_to(lab.root) for name in ("a", "b") for path in (lab.root / name).rglob("*")}
    assert taken == {*there, Path("a"), Path("b")}
    assert (tmp_path / "out" / "sessions" / "a" / odd.name).read_bytes() == odd.read_bytes()
    about = json.loads((tmp_path / "out" / "subject.json").read_text())
    assert (about["subject"]["name"], about["thresholds"][0]["force_N"]) == (NAME, 6.5)
    # An independent program checks the sums.
    subprocess.run(["sha256sum", "--check", "--strict", "--quiet", "SHA256SUMS"], cwd=tmp_path / "out", check=True)
    assert done.files == len([path for path in (tmp_path / "out").rglob("*") if path.is_file()]) - 1
    assert (tmp_path / "S01.zip").stat().st_mode & 0o077 == 0


def test_a_changed_byte_in_an_archive_is_found_by_its_sums(lab: Catalogue, tmp_path: Path) -> None:
    export_subject(lab, "S01", tmp_path / "S01.zip")
    with zipfile.ZipFile(tmp_path / "S01.zip") as archive:
        archive.extractall(tmp_path / "out")
    (tmp_path / "out" / "sessions" / "a" / "trial_001.mcap").write_bytes(b"planted")
    checked = subprocess.run(
        ["sha256sum", "--check", "SHA256SUMS"], cwd=tmp_path / "out", check=False, capture_output=True
    )
    assert checked.returncode == 1


def test_an_archive_without_names_holds_none(lab: Catalogue, tmp_path: Path) -> None:
    export_subject(lab, "S01", tmp_path / "S01.zip", named=False)
    with zipfile.ZipFile(tmp_path / "S01.zip") as archive:
        assert all(NAME.encode() not in archive.read(name) for name in archive.namelist())


def test_links_in_a_session_are_not_followed_into_an_archive(lab: Catalogue, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.mkdir()
    (secret / "key").write_text("of somebody else")
    (lab.root / "a" / "inside").symlink_to(secret)
    (lab.root / "a" / "file").symlink_to(secret / "key")
    os.mkfifo(lab.root / "a" / "pipe")
    done = export_subject(lab, "S01", tmp_path / "S01.zip")
    assert len(done.left_out) == 3 and "a/inside: is a link" in done.left_out[1] + done.left_out[0]
    with zipfile.ZipFile(tmp_path / "S01.zip") as archive:
        assert not any(name.endswith(("key", "file", "pipe")) for name in archive.namelist())


def test_an_archive_that_cannot_be_finished_leaves_nothing(
    lab: Catalogue, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("api.catalogue.subjects._add", full)
    with pytest.raises(Exception, match="No space left on device; nothing was left behind"):
        export_subject(lab, "S01", tmp_path / "S01.zip")
    assert not list(tmp_path.glob("*S01*"))


def test_the_first_step_erases_nothing_and_says_all(lab: Catalogue) -> None:
    planned = erase_subject(lab, "S01")
    assert (planned.done, planned.named, planned.sessions) == (False, True, ("a", "b"))
    assert planned.files == sum(path.is_file() for name in ("a", "b") for path in (lab.root / name).rglob("*"))
    for words in ("2 sessions are removed whole", "nothing brings them back", "backups of names"):
        assert words in planned.statement
    assert lab.history("S01").subject.sessions == 2


def test_the_second_step_takes_folders_tables_and_name_and_nothing_else(lab: Catalogue) -> None:
    planned = erase_subject(lab, "S01")
    done = erase_subject(lab, "S01", planned.confirm)
    assert done.done and done.sessions == planned.sessions
    assert [path.name for path in lab.root.iterdir()] == ["other"]
    assert [each.subject for each in lab.subjects().items] == ["S02"]
    assert lab.models().items == ()
    with pytest.raises(UsageError, match="has no session"):
        lab.history("S01")


@pytest.mark.parametrize("confirm", ["yes", "0" * 16, "S01", "\0"])
def test_another_word_confirms_nothing(lab: Catalogue, confirm: str) -> None:
    with pytest.raises(UsageError, match="is not what was confirmed; look at it again"):
        erase_subject(lab, "S01", confirm)
    assert lab.history("S01").subject.sessions == 2


def test_what_confirms_one_subject_or_an_earlier_state_confirms_no_other(lab: Catalogue) -> None:
    first = erase_subject(lab, "S01").confirm
    with pytest.raises(UsageError, match="not what was confirmed"):
        erase_subject(lab, "S02", first)
    make_session(lab.root, "new")
    with pytest.raises(UsageError, match="not what was confirmed"):
        erase_subject(lab, "S01", first)
    assert len(list(lab.root.iterdir())) == 4


def test_a_session_that_is_being_recorded_is_not_erased(lab: Catalogue) -> None:
    running = lab.root / "b" / "trial_002.mcap"
    running.write_bytes(b"\x89MCAP0\r\n and then the power of the bench")
    now_s = running.stat().st_mtime
    for late_s in (-30.0, 0.0, 30.0):
        with pytest.raises(UsageError, match="is not closed; wait until it is recorded"):
            erase_subject(lab, "S01", now_s=now_s + late_s)
    assert not erase_subject(lab, "S01", now_s=now_s + 3600).done
    assert not erase_subject(lab, "S01", now_s=now_s - 86_400).done  # a clock that was wrong holds nothing up


def test_an_erasure_that_fails_brings_everything_back(lab: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    planned = erase_subject(lab, "S01")

    def broken(*_: object) -> None:
        raise OSError(errno.EIO, "Input/output error", "disk")

    with monkeypatch.context() as patch:
        patch.setattr("api.catalogue.people.forget_name", broken)
        with pytest.raises(NotErased, match="nothing was erased"):
            erase_subject(lab, "S01", planned.confirm)
    assert sorted(path.name for path in lab.root.iterdir()) == ["a", "b", "other"]
    assert lab.history("S01").subject.name == NAME
    # The same word still counts: nothing has changed.
    assert erase_subject(lab, "S01", planned.confirm).done


def test_an_interrupted_removal_is_said_and_ended_by_a_rebuild(lab: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    planned = erase_subject(lab, "S01")
    with monkeypatch.context() as patch:
        patch.setattr("shutil.rmtree", lambda *_, **__: None)
        with pytest.raises(NotErased, match="could not be removed; see whose files they are"):
            erase_subject(lab, "S01", planned.confirm)
    assert left(lab.root)
    said = lab.sessions().remarks
    assert any("an erasure was interrupted; `rig catalogue rebuild` ends it" in each for each in said)
    lab.rebuild()
    assert not left(lab.root) and lab.sessions().remarks == ()


def test_a_link_in_an_erased_session_goes_and_what_it_leads_to_stays(lab: Catalogue, tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "file").write_text("kept")
    (lab.root / "a" / "link").symlink_to(tmp_path / "kept")
    (lab.root / f"{PREFIX}link").symlink_to(tmp_path / "kept")
    erase_subject(lab, "S01", erase_subject(lab, "S01").confirm)
    assert (tmp_path / "kept" / "file").read_text() == "kept"


def kept_bytes(lab: Catalogue) -> bytes:
    """What the files of the table of names hold; of a server after it has written all it had in memory."""
    file = lab.database.file
    if file is not None:
        return b"".join(path.read_bytes() for path in file.parent.glob(f"{file.name}*"))
    with lab.database.engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        connection.exec_driver_sql("CHECKPOINT")
        where = connection.exec_driver_sql("SELECT pg_relation_filepath('rig_person')").scalar_one()
    return (Path(str(lab.database.url.query["host"])) / "data" / str(where)).read_bytes()


def test_a_name_that_was_erased_is_in_no_file_of_its_table(lab: Catalogue) -> None:
    assert NAME.encode() in kept_bytes(lab)
    erase_subject(lab, "S01", erase_subject(lab, "S01").confirm)
    assert NAME.encode() not in kept_bytes(lab)


def test_a_table_that_is_not_compacted_would_keep_the_name(lab: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    """The plant: a server that keeps deleted rows in the file of the table, SQLite that does not overwrite pages."""
    if lab.database.is_sqlite:
        monkeypatch.setattr("api.catalogue.database.ON_CONNECT", "PRAGMA secure_delete = OFF")
    else:
        monkeypatch.setattr("api.catalogue.database.Database.compact", lambda _: None)
    erase_subject(lab, "S01", erase_subject(lab, "S01").confirm)
    assert NAME.encode() in kept_bytes(lab)


def test_sessions_in_the_trash_are_erased_too_and_no_other_s(lab: Catalogue) -> None:
    trash = lab.root / ".service" / "trash"
    mine = make_session(trash, "20261123-a")
    make_session(trash, "20261123-other", OTHER)
    planned = erase_subject(lab, "S01")
    assert planned.sessions[-1] == str(mine.relative_to(lab.root))
    erase_subject(lab, "S01", planned.confirm)
    assert [path.name for path in trash.iterdir()] == ["20261123-other"]


def test_a_subject_whose_sessions_are_all_in_the_trash_can_be_erased(lab: Catalogue) -> None:
    trash = lab.root / ".service" / "trash"
    make_session(trash, "20261123-other", OTHER)
    shutil.rmtree(lab.root / "other")
    planned = erase_subject(lab, "S02")
    assert (planned.named, planned.files) == (False, 2)
    assert erase_subject(lab, "S02", planned.confirm).done
    assert not list(trash.iterdir())
    with pytest.raises(UsageError, match="has no session"):
        erase_subject(lab, "S02")


def test_sessions_that_nobody_can_read_are_named_before_an_erasure(lab: Catalogue) -> None:
    unknown = lab.root / "unknown"
    unknown.mkdir()
    (unknown / "trial_001.mcap").write_bytes(b"of whom?")
    assert "Nobody can say whose these are: unknown." in erase_subject(lab, "S01").statement
