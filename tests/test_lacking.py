"""A test that finds no browser or database skips for a person and fails in CI."""

from collections.abc import Callable

import pytest

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


@pytest.mark.parametrize("act", [without_browser, without_database])
def test_what_lacks_is_skipped_or_fails_where_all_have_to_run(
    monkeypatch: pytest.MonkeyPatch, act: Callable[[pytest.MonkeyPatch], None]
) -> None:
    monkeypatch.delenv(ALL, raising=False)
    with pytest.raises(pytest.skip.Exception):
        act(monkeypatch)
    monkeypatch.setenv(ALL, "1")
    with pytest.raises(pytest.fail.Exception, match="no test may skip"):
        act(monkeypatch)
