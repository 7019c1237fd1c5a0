"""Every message that the page on troubleshooting lists is one that the code can print."""

import re
from pathlib import Path

import pytest

from tests.messages import can_be_said, every_text, texts_in

PAGE = Path(__file__).parents[1] / "docs" / "how-to" / "troubleshooting.md"
# A definition list: the message in backticks, two where it holds some itself, and on the next line what it means.
LISTED = re.compile(r"^(`{1,2}) ?(.+?) ?\1\n: ", re.MULTILINE)
MESSAGES = [found[2] for found in LISTED.finditer(PAGE.read_text())]


def test_the_page_lists_messages_of_every_part_once() -> None:
    assert len(MESSAGES) == PAGE.read_text().count("\n: ") >= 40
    assert len(set(MESSAGES)) == len(MESSAGES)


@pytest.mark.parametrize("message", MESSAGES)
def test_a_message_that_is_listed_can_be_printed(message: str) -> None:
    assert can_be_said(message, every_text()), f"no source says: {message}"


@pytest.mark.parametrize(
    "source",
    [
        'raise E(f"{path}: is damaged: {why}; mend it")',
        'x = (f"{path}: is "\n  "damaged: "\n  f"{why}; mend it")',
        'def f(): return "disk: is damaged: all; mend it"',
    ],
)
def test_a_message_is_found_however_it_is_put_together(source: str) -> None:
    assert can_be_said("…: is damaged: …; mend it", tuple(texts_in(source)))


@pytest.mark.parametrize(
    "source",
    [
        '"""…: is damaged: all; mend it"""',
        'def f():\n  """x: is damaged: y; mend it"""',
        "# x: is damaged: y; mend it",
        'a = "x: is damaged: y"\nb = "; mend it"',
        'a = "; mend it x: is damaged: y"',
        'raise E(f"{path}: is broken: {why}; mend it")',
    ],
)
def test_a_message_that_nobody_prints_is_not_found(source: str) -> None:
    """The plants: a docstring, a comment, two halves in two texts, another order, another word."""
    assert not can_be_said("…: is damaged: …; mend it", tuple(texts_in(source)))


def test_a_message_of_gaps_alone_is_none() -> None:
    assert not can_be_said("… …", ("anything",))
