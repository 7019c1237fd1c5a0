"""SQLite and PostgreSQL hold the same and answer the same, also for what people should not write but do."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

from api.catalogue.catalogue import Catalogue
from api.catalogue.pages import Page
from api.catalogue.queries import Asked, listed
from api.catalogue.schema import PERSON, STAMP, TABLES
from rig.results.catalogue import SessionEntry, TrialEntry
from tests.api.catalogue.made import diagnosed, fitted, make_session, trial, with_threshold
from tests.api.catalogue.server import emptied

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("postgresql")]
# Order by language, case and accents differs from order by code point; quotes, NUL and emoji are what breaks queries.
CODES = ("a", "B", "ä", "Z", "é'\"; --", "nul\0nul", "half \ud800", "😀", "x" * 3000, "%", "_", "S 1", " S2 ", "007")
NAMES = ("with space", "quote'", 'double"', "new\nline", "ümlaut", "😀", "-dash", "percent%41", "back\\slash", "a..b")


@pytest.fixture
def both(root: Path, tmp_path: Path, postgresql: Path) -> tuple[Catalogue, Catalogue]:
    for number, name in enumerate(NAMES):
        code = CODES[number % len(CODES)]
        make_session(
            root, name, {"id": code.replace("\ud800", ""), "site": name}, created=f"2026-11-{20 - number:02d}T08:00"
        )
    for number, code in enumerate(CODES):
        folder = make_session(root, f"code {number}", {"id": "?", "site": "arm"}, trials=(trial(1), trial(2, "bad")))
        file = folder / "session.json"
        file.write_text(file.read_text().replace('"?"', _json(code)))
    with_threshold(diagnosed(fitted(make_session(root, "whole")), "friction", "drift"), 5.0)
    return Catalogue(root, str(tmp_path / "one.sqlite")), Catalogue(root, emptied(postgresql))


def _json(text: str) -> str:
    return '"' + "".join(f"\\u{ord(each):04x}" if ord(each) < 0x10000 else each for each in text) + '"'


def dump(catalogue: Catalogue) -> dict[str, list[Any]]:
    with catalogue.database.reading() as connection:
        return {
            table.name: [tuple(row) for row in connection.execute(select(table).order_by(*table.primary_key))]
            for table in (*TABLES.values(), STAMP, PERSON)
        }


def pages(catalogue: Catalogue) -> Iterator[tuple[str, ...]]:
    cursor: str | None = ""
    while cursor is not None:
        found = catalogue.sessions(page=Page(limit=3, cursor=cursor))
        cursor = found.next
        yield tuple(session.session for session in found.items)


def test_a_rebuild_into_one_equals_that_into_the_other(both: tuple[Catalogue, Catalogue]) -> None:
    one, other = both
    assert [each.rebuild().sessions for each in both] == [len(NAMES) + len(CODES) + 1] * 2
    assert dump(one) == dump(other)
    assert list(pages(one)) == list(pages(other))
    assert len({name for page in pages(one) for name in page}) == len(NAMES) + len(CODES) + 1


def test_each_code_is_found_by_itself_alone_in_both(both: tuple[Catalogue, Catalogue]) -> None:
    one, other = both
    subjects = one.subjects()
    assert subjects == other.subjects()
    # The half of a character cannot be read from a list at all; blanks around a code are none of it.
    assert {"ä", "é'\"; --", "nul\ufffdnul", "😀", "S2", "007"} <= {each.subject for each in subjects.items}
    for subject in subjects.items:
        found = [each.sessions(Asked(subject=subject.subject)).items for each in both]
        assert found[0] == found[1]
        assert len(found[0]) == subject.sessions
        assert one.history(subject.subject) == other.history(subject.subject)


def test_an_order_by_language_would_be_noticed(both: tuple[Catalogue, Catalogue]) -> None:
    """The plant: PostgreSQL asked to sort as people do, where the order is by code point."""
    _, other = both
    other.refreshed()
    with other.database.reading() as connection:
        by_point = [each.site for each in listed(connection, SessionEntry)[0]]
        table = TABLES[SessionEntry]
        ordered = [
            list(connection.scalars(select(table.c.site).order_by(table.c.site.collate(name))))
            for name in ("C", "und-x-icu")
        ]
    assert ordered[0] != ordered[1] and sorted(by_point) == ordered[0]


def test_numbers_that_are_none_are_null_in_both(both: tuple[Catalogue, Catalogue]) -> None:
    for catalogue in both:
        bad = catalogue.trials(Asked(quality="bad")).items
        # One list has half a character in it, which JSON readers refuse.
        assert len(bad) == len(CODES) - 1 and all(each.peak_force_N is None for each in bad)
        assert isinstance(bad[0], TrialEntry)
