"""Every extra works without the others, in a fresh environment; a plant would pass beside all of them."""

from pathlib import Path

import pytest

from tests.lacking import lacking
from tools import one_extra
from tools.exchanges import igtl
from tools.one_extra import SMOKES, NoRegistry, Smoke, extras, trouble_of


def test_each_extra_for_users_is_tried() -> None:
    assert list(SMOKES) == extras()
    assert {"lsl", "glove", "igtl", "zaber", "multicast", "cluster", "s3", "foxglove", "postgresql"} <= set(SMOKES)


def test_each_is_tried_by_an_exchange_but_where_there_is_nothing_to_talk_to() -> None:
    assert {extra for extra, smoke in SMOKES.items() if "exchange()" not in smoke.works} == {"gs_usb", "pandas"}


@pytest.mark.extra
def test_an_exchange_that_says_something_else_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(igtl, "TIP", (0.0,) * 8)
    with pytest.raises(AssertionError):
        igtl.exchange()


def tried(extra: str, folder: Path) -> str:
    try:
        return trouble_of(extra, folder / "venv")
    except NoRegistry as error:
        lacking(f"no package registry answers here: {error}")


@pytest.mark.extra
@pytest.mark.timeout(300)
def test_one_that_needs_another_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In this environment, which has them all, the planted one would pass."""
    monkeypatch.setitem(one_extra.SMOKES, "glove", Smoke("pyfirmata2", "import pylsl"))
    assert "No module named 'pylsl'" in tried("glove", tmp_path)


@pytest.mark.extra
@pytest.mark.timeout(300)
@pytest.mark.parametrize("extra", ["glove", "lsl"])
def test_an_input_works_with_its_own_extra_alone(extra: str, tmp_path: Path) -> None:
    assert tried(extra, tmp_path) == ""


@pytest.mark.extra
@pytest.mark.timeout(300)
def test_without_it_one_sentence_names_it(tmp_path: Path) -> None:
    try:
        python = one_extra.installed(tmp_path / "venv", "")
    except NoRegistry as error:
        lacking(f"no package registry answers here: {error}")
    said = one_extra.run(python, "from drivers.lsl.library import load; load('machine')")
    assert "pip install 'tissue-rig[lsl]'" in said


def test_without_a_registry_nothing_is_tried_and_that_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def unreachable(*_: str) -> None:
        raise NoRegistry("dns error")

    monkeypatch.setattr(one_extra, "_uv", unreachable)
    assert one_extra.main(["lsl"]) == 0
    assert capsys.readouterr().out.startswith("no package registry answers here")


def test_one_that_does_not_work_fails_the_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(one_extra, "trouble_of", lambda extra, _: "" if extra == "lsl" else "planted")
    assert one_extra.main(["lsl", "glove"]) == 1
    assert capsys.readouterr().out == "lsl: works by itself\nglove: planted\n"
