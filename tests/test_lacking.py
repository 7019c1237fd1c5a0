"""A test that finds no browser, database or recording skips for a person and fails in CI."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mock_devices.testing import real_data
from tests import data
from tests.api.catalogue import server
from tests.lacking import ALL
from tests.system import browser


def without_browser(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(browser, "installed", lambda: None)
    browser.find()


def without_database(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(server, "programs", lambda: None)
    with server.cluster():
        pass


def without_one_recording(patch: pytest.MonkeyPatch) -> None:
    patch.delenv("TISSUE_RIG_DATA", raising=False)
    patch.setattr(data, "folder", lambda: Path(__file__).parent)
    data.recording("no-such-recording")


def without_promised_recordings(patch: pytest.MonkeyPatch) -> None:
    patch.setenv("TISSUE_RIG_DATA", "/no/such/folder")
    data.recording("emps")


@pytest.mark.parametrize("act", [without_browser, without_database, without_one_recording, without_promised_recordings])
def test_what_lacks_is_skipped_or_fails_where_all_have_to_run(
    monkeypatch: pytest.MonkeyPatch, act: Callable[[pytest.MonkeyPatch], None]
) -> None:
    monkeypatch.delenv(ALL, raising=False)
    with pytest.raises(pytest.skip.Exception):
        act(monkeypatch)
    monkeypatch.setenv(ALL, "1")
    with pytest.raises((pytest.fail.Exception, pytest.skip.Exception), match="no test may skip"):
        act(monkeypatch)


def skips_unseen(source: str) -> bool:
    """Whether a test file leaves tests out where a library is absent, in CI too."""
    return "importorskip" in source


def test_a_library_that_is_absent_is_a_failure() -> None:
    here = Path(__file__)
    assert [file for file in here.parent.rglob("*.py") if file != here and skips_unseen(file.read_text())] == []
    assert skips_unseen('pylsl = pytest.importorskip("pylsl")')


def test_where_nobody_promised_recordings_their_tests_skip_even_where_all_have_to_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(ALL, "1")
    monkeypatch.delenv("TISSUE_RIG_DATA", raising=False)
    monkeypatch.setattr(real_data, "ROOT", tmp_path / "project")
    with pytest.raises(pytest.skip.Exception, match="no recording emps"):
        data.recording("emps")
