"""A database that is damaged, newer, foreign, locked or away is said in one sentence with what to do next."""

import multiprocessing
import sqlite3
import threading
from multiprocessing.synchronize import Barrier
from pathlib import Path

import pytest
from sqlalchemy import select

from api.catalogue import database as database_module
from api.catalogue.catalogue import Catalogue, default_file
from api.catalogue.database import CatalogueDamaged, CatalogueUnavailable, address
from api.catalogue.schema import CATALOGUE, VERSION
from rig.errors import UsageError
from tests.api.catalogue.made import make_session

WRITERS, EACH = 4, 5


@pytest.fixture
def lab(root: Path, database: str) -> Catalogue:
    make_session(root, "a")
    found = Catalogue(root, database)
    found.rename("S01", "Ann Example")
    found.refreshed()
    return found


@pytest.fixture
def file(root: Path, tmp_path: Path) -> Path:
    """A catalogue of SQLite with forty names and a session."""
    make_session(root, "a")
    found = Catalogue(root, str(tmp_path / "c.sqlite"))
    found.refreshed()
    for number in range(40):
        found.rename(f"P{number:02d}", f"Person {number} " + "x" * 400)
    return tmp_path / "c.sqlite"


def test_a_newer_catalogue_is_refused_and_not_rebuilt(lab: Catalogue, root: Path, database: str) -> None:
    with lab.database.writing() as connection:
        connection.execute(CATALOGUE.update().values(version=VERSION + 1))
    again = Catalogue(root, database)
    for ask in (again.sessions, again.rebuild, again.subjects):
        with pytest.raises(UsageError, match=rf"is a catalogue of version {VERSION + 1}, and this program knows up to"):
            ask()
    with lab.database.reading() as connection:
        assert connection.scalar(select(CATALOGUE.c.version)) == VERSION + 1


def test_a_catalogue_of_an_older_program_is_read_anew_and_keeps_its_names(
    lab: Catalogue, root: Path, database: str
) -> None:
    with lab.database.writing() as connection:
        connection.execute(CATALOGUE.update().values(version=VERSION - 1))
        connection.exec_driver_sql("ALTER TABLE rig_session DROP COLUMN quality")
        connection.exec_driver_sql("UPDATE rig_trial SET quality = 'as it was read before'")
    again = Catalogue(root, database)
    assert [each.quality for each in again.sessions().items] == ["good"]
    assert [each.quality for each in again.trials().items] == ["good"]
    assert again.subjects().items[0].name == "Ann Example"
    with lab.database.reading() as connection:
        assert connection.scalar(select(CATALOGUE.c.version)) == VERSION


def test_a_catalogue_of_another_folder_is_refused_until_it_is_rebuilt(
    lab: Catalogue, tmp_path: Path, database: str
) -> None:
    make_session(tmp_path / "other", "x", {"id": "S50"})
    other = Catalogue(tmp_path / "other", database)
    with pytest.raises(UsageError, match=r"is the catalogue of .*sessions, not of .*other"):
        other.sessions()
    assert other.rebuild().names == 1
    assert [each.session for each in other.sessions().items] == ["x"]


def test_tables_that_were_changed_are_said_and_rebuilt_with_all_names(
    lab: Catalogue, root: Path, database: str
) -> None:
    with lab.database.writing() as connection:
        connection.exec_driver_sql("DROP TABLE rig_trial")
        connection.exec_driver_sql("ALTER TABLE rig_session DROP COLUMN quality")
    again = Catalogue(root, database)
    make_session(root, "b")
    with pytest.raises(CatalogueDamaged, match="`rig catalogue rebuild` makes it anew"):
        again.sessions()
    assert (again.rebuild().sessions, again.subjects().items[0].name) == (2, "Ann Example")
    assert len(again.trials().items) == 2


def test_the_file_beside_the_folder_moves_with_it(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RIG_CATALOGUE", raising=False)
    make_session(root, "a")
    Catalogue(root).rename("S01", "Ann")
    file = default_file(root)
    assert file == root.with_name("sessions.catalogue.sqlite") and file.stat().st_mode & 0o077 == 0
    moved = root.rename(root.with_name("moved"))
    file.rename(default_file(moved))
    assert [each.name for each in Catalogue(moved).subjects().items] == ["Ann"]


def test_where_it_is_can_be_said_by_the_environment(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RIG_CATALOGUE", str(tmp_path / "there.sqlite"))
    Catalogue(root).refreshed()
    assert (tmp_path / "there.sqlite").exists() and not default_file(root).exists()


@pytest.mark.parametrize("data", [b"no database at all" * 100, b"SQLite format 3\0" + b"\xff" * 4000])
def test_what_is_no_database_is_said_put_aside_and_made_anew(root: Path, file: Path, data: bytes) -> None:
    file.write_bytes(data)
    lab = Catalogue(root, str(file))
    with pytest.raises(
        CatalogueDamaged, match=r"is damaged: .*; `rig catalogue rebuild` makes it anew from the folders"
    ):
        lab.sessions()
    assert file.read_bytes() == data
    made = lab.rebuild()
    assert (made.sessions, made.names) == (1, 0)
    assert "0 names saved" in made.remarks[2] and "`rig catalogue restore`" in made.remarks[2]
    (aside,) = file.parent.glob("c.sqlite.damaged-*")
    assert aside.read_bytes() == data
    assert len(lab.sessions().items) == 1


def test_names_before_the_damage_are_saved(root: Path, file: Path) -> None:
    data = bytearray(file.read_bytes())
    connection = sqlite3.connect(file)
    page = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = 'rig_session'").fetchone()[0]
    connection.close()
    data[(page - 1) * 4096 : page * 4096] = b"\xaa" * 4096
    file.write_bytes(data)
    lab = Catalogue(root, str(file))
    with pytest.raises(CatalogueDamaged):
        lab.sessions()
    made = lab.rebuild()
    assert made.names == 40 and "40 names saved, all there were" in made.remarks[2]
    assert len(lab.subjects().items) == 41


def test_another_program_s_database_is_left_alone(root: Path, tmp_path: Path) -> None:
    other = tmp_path / "thesis.sqlite"
    connection = sqlite3.connect(other)
    connection.execute("CREATE TABLE chapters (text)")
    connection.commit()
    connection.close()
    before = other.read_bytes()
    lab = Catalogue(root, str(other))
    for ask in (lab.sessions, lab.rebuild):
        with pytest.raises(UsageError, match="is a database, but no catalogue; give another file with --catalogue"):
            ask()
    assert other.read_bytes() == before


def test_a_file_that_is_removed_under_the_service_is_made_again(root: Path, file: Path) -> None:
    lab = Catalogue(root, str(file))
    assert len(lab.sessions().items) == 1
    file.unlink()
    assert len(lab.sessions().items) == 1


def test_a_place_that_cannot_be_written_is_said(root: Path, tmp_path: Path) -> None:
    with pytest.raises(CatalogueUnavailable, match=r"cannot be made: No such file or directory; give another place"):
        Catalogue(root, str(tmp_path / "none" / "c.sqlite")).sessions()
    with pytest.raises(CatalogueUnavailable, match="cannot be opened"):
        Catalogue(root, str(tmp_path)).sessions()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("mysql://root@host/db", "give a file, or postgresql://"),
        ("postgresql://u:secret@host:notaport/db", "--catalogue"),
        ("http://host/", "give a file, or postgresql://"),
        ("://", "--catalogue"),
    ],
)
def test_an_address_that_is_none_is_refused_without_its_password(root: Path, given: str, said: str) -> None:
    with pytest.raises(UsageError, match=said) as refused:
        Catalogue(root, given)
    assert "secret" not in str(refused.value)


def test_a_server_that_is_not_there_is_said_without_the_password(root: Path, tmp_path: Path) -> None:
    lab = Catalogue(root, f"postgresql://rig:secret@/lab?host={tmp_path}")
    with pytest.raises(CatalogueUnavailable, match="see that the server runs and lets this account in") as refused:
        lab.sessions()
    assert "secret" not in str(refused.value)


def test_the_address_of_a_file_may_have_any_character(root: Path, tmp_path: Path) -> None:
    odd = tmp_path / "a?b=c#d %41é.sqlite"
    Catalogue(root, str(odd)).refreshed()
    assert odd.exists()
    assert address("", odd).database == str(odd)


def test_a_writer_that_hangs_is_said_after_a_while(root: Path, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(database_module, "WAIT_S", 0.2)
    lab, other = Catalogue(root, str(file)), sqlite3.connect(file, isolation_level=None)
    lab.refreshed()
    other.execute("BEGIN EXCLUSIVE")
    try:
        with pytest.raises(CatalogueUnavailable, match=r"another program has been writing to it for 0.2 s"):
            lab.rename("S01", "Bo")
    finally:
        other.execute("ROLLBACK")
        other.close()
    lab.rename("S01", "Bo")


def _write(root: Path, given: str, number: int, together: Barrier) -> None:
    """One of several programs: names people and brings the tables up to date while sessions come and go."""
    lab = Catalogue(root, given)
    together.wait()
    for turn in range(EACH):
        make_session(root, f"w{number}-{turn}", {"id": f"W{number}"})
        lab.rename(f"W{number}-{turn}", f"Writer {number}")
        lab.refreshed()


def _rebuild(root: Path, given: str, together: Barrier) -> None:
    """Another program, which makes the tables anew over and over beside them."""
    lab = Catalogue(root, given)
    together.wait()
    for _ in range(EACH):
        assert "S01" in {each.subject for each in lab.subjects().items}
        assert lab.rebuild().names >= 1


@pytest.mark.timeout(300)
def test_what_several_programs_write_at_once_is_all_there(lab: Catalogue, root: Path, database: str) -> None:
    context = multiprocessing.get_context("spawn")
    together = context.Barrier(WRITERS + 1)
    writers = [context.Process(target=_write, args=(root, database, each, together)) for each in range(WRITERS)]
    writers.append(context.Process(target=_rebuild, args=(root, database, together)))
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
        assert writer.exitcode == 0
    subjects = lab.subjects().items
    assert len([each for each in subjects if each.name]) == WRITERS * EACH + 1
    assert {each.subject: each.sessions for each in subjects if each.sessions} == {
        "S01": 1, **{f"W{number}": EACH for number in range(WRITERS)}
    }  # fmt: skip


def test_writers_that_do_not_wait_for_each_other_would_be_seen(
    root: Path, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The plant: a writer that begins as a reader, so that two of them refuse each other."""
    monkeypatch.setattr(database_module, "_alone", lambda _: False)
    monkeypatch.setattr(database_module, "WAIT_S", 1.0)
    lab, together, failed = Catalogue(root, str(file)), threading.Barrier(2, timeout=10), []
    lab.refreshed()

    def write(number: int) -> None:
        try:
            with lab.database.writing() as connection:
                connection.scalar(select(CATALOGUE.c.version))
                together.wait()
                connection.execute(CATALOGUE.update().values(root=str(number)))
        except CatalogueUnavailable as error:
            failed.append(str(error))

    threads = [threading.Thread(target=write, args=(number,)) for number in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed


def test_a_rebuild_that_fails_changes_nothing(lab: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    before = lab.sessions()

    def broken(*_: object) -> None:
        raise OSError("planted")

    with monkeypatch.context() as patch:
        patch.setattr("api.catalogue.refresh.replace", broken)
        with pytest.raises(OSError, match="planted"):
            lab.rebuild()
    assert lab.sessions() == before
