"""`rig catalogue` and `rig subject` as they are typed: what is shown, written as JSON, and refused in one sentence."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from api.cli.app import build
from rig.errors import UsageError
from rig.results.catalogue import ErasureResult, SessionList, SubjectHistory
from tests.api.catalogue.made import diagnosed, fitted, make_session, trial, with_threshold


@pytest.fixture(autouse=True)
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("RIG_CATALOGUE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    root = tmp_path / "sessions"
    with_threshold(diagnosed(fitted(make_session(root, "first")), "friction"), 7.25)
    make_session(root, "second", {"id": "S02", "site": "calf"}, trials=(trial(1, "bad"),))
    return root


def rig(*words: str) -> Result:
    return CliRunner().invoke(build(words[0]), list(words), terminal_width=200)


def refused(*words: str) -> str:
    answer = rig(*words)
    assert isinstance(answer.exception, UsageError), answer.output
    assert answer.exception.exit_code == 2
    return str(answer.exception)


@pytest.mark.parametrize(
    ("what", "shown"),
    [
        ("sessions", "first"),
        ("trials", "force scatters by 0.3 N in the air"),
        ("models", "index"),
        ("diagnoses", "explained"),
        ("causes", "it is friction"),
        ("operations", "threshold"),
        ("sites", "calf"),
    ],
)
def test_each_list_is_shown_and_written(what: str, shown: str, tmp_path: Path) -> None:
    answer = rig("catalogue", what, "--json", "out.json")
    assert answer.exit_code == 0, answer.output
    assert shown in " ".join(answer.output.split())
    assert json.loads((tmp_path / "out.json").read_text())["items"]


def test_filters_and_pages_are_options(tmp_path: Path) -> None:
    rig("catalogue", "sessions", "--subject", "S02", "--json", "out.json")
    assert [each.session for each in SessionList.read(tmp_path / "out.json").items] == ["second"]
    first = rig("catalogue", "sessions", "--limit", "1").output
    assert "first" in first and "second" not in first
    cursor = first.partition("there are more: --cursor ")[2].strip()
    rest = rig("catalogue", "sessions", "--limit", "1", "--cursor", cursor).output
    assert "second" in rest and "there are more" not in rest


def test_names_are_backed_up_rebuilt_around_and_restored(lab: Path, tmp_path: Path) -> None:
    assert rig("subject", "name", "S01", "Ann Example").exit_code == 0
    assert "1 names kept" in rig("catalogue", "backup", "names.json").output
    (tmp_path / "sessions.catalogue.sqlite").write_bytes(b"damaged" * 1000)
    assert "rig catalogue rebuild" in str(rig("catalogue", "sessions").exception)
    assert "2 sessions of 2 subjects, 0 names" in rig("catalogue", "rebuild").output
    assert "1 names brought back" in rig("catalogue", "restore", "names.json").output
    assert "Ann Example" in rig("subject", "list").output


def test_a_subject_is_shown_exported_and_erased_in_two_steps(lab: Path, tmp_path: Path) -> None:
    rig("subject", "show", "S01", "--json", "out.json")
    assert SubjectHistory.read(tmp_path / "out.json").thresholds[0].force_N == 7.25
    shown = rig("subject", "show", "S01").output
    assert "7.25" in shown and "friction" in shown and "no name is kept" in shown
    assert "1 sessions" in rig("subject", "export", "S01", "--out", "S01.zip").output
    first = rig("subject", "erase", "S01", "--json", "plan.json").output
    plan = ErasureResult.read(tmp_path / "plan.json")
    assert "nothing is erased yet" in first and f"rig subject erase S01 --confirm {plan.confirm}" in first
    assert (lab / "first").exists()
    assert "erased: 1 sessions" in rig("subject", "erase", "S01", "--confirm", plan.confirm).output
    assert not (lab / "first").exists() and (lab / "second").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("catalogue", "sessions", "--sessions", "none"), "none: no such folder of sessions; give it with --sessions"),
        (("catalogue", "sessions", "file"), "file: says nothing to `rig catalogue sessions`; leave it out"),
        (("catalogue", "backup"), "give the file of names, as in: rig catalogue backup names.json"),
        (("catalogue", "restore", "none.json"), "none.json: cannot be read"),
        (("catalogue", "sessions", "--limit", "0"), "a page has 1 to 500 entries"),
        (("catalogue", "sessions", "--since", "soon"), "since 'soon': is no date"),
        (("catalogue", "sessions", "--cursor", "x"), "is none that was given"),
        (("catalogue", "sessions", "--catalogue", "mysql://x"), "postgresql://USER@HOST/NAME"),
        (("subject", "show"), "give the subject's code"),
        (("subject", "show", "S99"), "has no session in sessions and no name"),
        (("subject", "name", "S01"), 'rig subject name S01 "Ann Example"'),
        (("subject", "export", "S01"), "--out S01.zip"),
        (("subject", "erase", "S01", "--confirm", "yes"), "look at it again, without --confirm"),
    ],
)
def test_wrong_use_is_one_sentence_and_makes_no_file(words: tuple[str, ...], said: str, tmp_path: Path) -> None:
    assert said in refused(*words)
    assert {path.name for path in tmp_path.iterdir()} <= {"sessions", "sessions.catalogue.sqlite"}
