"""Names are only in the catalogue: they are backed up, brought back, and kept through a rebuild."""

import json
import stat
from pathlib import Path

import pytest

from api.catalogue.catalogue import Catalogue
from rig.errors import UsageError
from tests.api.catalogue.made import make_session


@pytest.fixture
def lab(root: Path, database: str) -> Catalogue:
    make_session(root, "a")
    return Catalogue(root, database)


def named(catalogue: Catalogue) -> dict[str, str | None]:
    return {each.subject: each.name for each in catalogue.subjects().items if each.name}


def test_a_name_is_kept_changed_shown_only_to_who_may_and_forgotten(lab: Catalogue) -> None:
    lab.rename("S01", "  Ann Example ")
    lab.rename("S07", "Bo")
    assert named(lab) == {"S01": "Ann Example", "S07": "Bo"}
    assert lab.history("S01").subject.name == "Ann Example"
    assert lab.history("S01", named=False).subject.name is None
    assert [each.subject for each in lab.subjects(named=False).items] == ["S01"]
    lab.rename("S01", "Ann Other")
    lab.rename("S07", "")
    assert named(lab) == {"S01": "Ann Other"}
    with pytest.raises(UsageError, match="no name is kept for it"):
        lab.rename("S07", " ")
    with pytest.raises(UsageError, match="its code is empty"):
        lab.rename("  ", "Nobody")


def test_a_backup_is_for_its_owner_alone_and_brings_names_back_into_any_catalogue(
    lab: Catalogue, root: Path, tmp_path: Path
) -> None:
    lab.rename("S01", "Änn\nExämple 😀")
    file = tmp_path / "names.json"
    assert lab.backup(file).names == 1
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    other = Catalogue(root, str(tmp_path / "other.sqlite"))
    assert other.restore(file).names == 1
    assert named(other) == named(lab)
    with pytest.raises(UsageError, match="exists already and is not overwritten"):
        lab.backup(file)


def test_what_was_entered_since_the_backup_stays(
    lab: Catalogue, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.catalogue.people.now", lambda: "2026-11-20T10:00:00Z")
    for code in ("S01", "S02", "S03"):
        lab.rename(code, f"old {code}")
    lab.backup(tmp_path / "names.json")
    monkeypatch.setattr("api.catalogue.people.now", lambda: "2026-11-21T10:00:00Z")
    lab.rename("S01", "new")
    lab.rename("S02", "")
    lab.rename("S09", "later")
    assert lab.restore(tmp_path / "names.json").names == 1
    assert named(lab) == {"S01": "new", "S02": "old S02", "S03": "old S03", "S09": "later"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "holds no NamesBackup"),
        ("{", "holds no NamesBackup"),
        ('{"format": "other", "people": []}', "holds no NamesBackup"),
        ('{"people": [{"subject": "", "name": "x"}]}', "holds no NamesBackup"),
        (json.dumps({"version": 99, "people": []}), "newer than 1"),
    ],
)
def test_what_is_no_backup_is_refused_and_changes_nothing(lab: Catalogue, tmp_path: Path, text: str, said: str) -> None:
    lab.rename("S01", "Ann")
    file = tmp_path / "names.json"
    file.write_text(text)
    with pytest.raises(UsageError, match=said):
        lab.restore(file)
    with pytest.raises(UsageError, match="No such file"):
        lab.restore(tmp_path / "none.json")
    assert named(lab) == {"S01": "Ann"}
