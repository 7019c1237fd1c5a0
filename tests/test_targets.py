"""Which tests each command of the Makefile runs: every one has its place, and none for the hand takes CI's time."""

import itertools
import re

import pytest
from _pytest.mark.expression import Expression

from mock_devices.testing.commands import ROOT

MARKERS = ("bench", "campaign", "documents", "extra", "long")
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")


def selections(makefile: str) -> dict[str, list[str]]:
    """By target, what its calls of pytest select beside the page's tests."""
    main = re.findall(r"^MAIN := (.+)$", makefile, re.MULTILINE)[0]
    found: dict[str, list[str]] = {}
    for target, recipe in re.findall(r"^([a-z-]+):[^=\n]*\n((?:\t.*\n)+)", makefile, re.MULTILINE):
        for line in re.findall(r"/pytest (.+)", recipe):
            if "tests/page" not in line.replace("--ignore tests/page", "") and "$(PAGE)" not in line:
                asked = re.findall(r"""-m (?:"([^"]+)"|(\w+))""", line)[0]
                found.setdefault(target, []).append("".join(asked).replace("$(MAIN)", main))
    return found


def places(markers: set[str], makefile: str = MAKEFILE) -> list[str]:
    """The targets that run a test with ``markers``, one for each time."""
    return [
        target
        for target, asked in selections(makefile).items()
        for one in asked
        if Expression.compile(one).evaluate(lambda name, /, **_: name in markers)
    ]


@pytest.mark.parametrize(
    ("markers", "target"),
    [
        (set(), "test"),
        ({"bench"}, "test"),
        ({"documents"}, "test-documents"),
        ({"documents", "bench"}, "test-documents"),
        ({"campaign"}, "test-campaigns"),
        ({"campaign", "bench"}, "test-campaigns"),
        ({"extra"}, "test-extras"),
        ({"extra", "bench"}, "test-extras"),
        ({"long"}, "test-long"),
        ({"long", "bench"}, "test-long"),
    ],
)
def test_a_test_runs_once_in_ci(markers: set[str], target: str) -> None:
    assert places(markers) == [target]


@pytest.mark.parametrize("size", range(len(MARKERS) + 1))
def test_what_is_for_the_hand_runs_in_the_campaigns_alone(size: int) -> None:
    for markers in itertools.combinations(MARKERS, size):
        assert places({*markers, "by_hand"}) == ["campaigns"], markers


def test_a_target_that_forgets_what_is_for_the_hand_is_told() -> None:
    forgetful = MAKEFILE.replace("extra and not by_hand", "extra")
    assert places({"extra", "by_hand"}, forgetful) == ["test-extras", "campaigns"]
