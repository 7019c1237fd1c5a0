"""The benchmark of contact in recordings says no to intervals that hold the surface less often than they say."""

import json

import numpy as np
import pytest

from benchmarks import preload
from benchmarks.preload import Answer, _row, missed
from mock_devices.testing.made.preloaded import SURFACE_MM


def row(held: int, of: int) -> dict[str, float]:
    """Of so many answers so many held."""
    return dict(_row([Answer("index", number < held, 0.1) for number in range(of)]))


def test_good_shares_are_let_pass() -> None:
    assert missed({"a": row(95, 100), "b": row(60, 60)}) == []


def test_a_line_that_holds_too_seldom_for_chance_is_told() -> None:
    (said,) = missed({"a": row(85, 100), "b": row(400, 400)})
    assert said.startswith("a: 0.765 to 0.913 held")


def test_all_lines_together_may_not_fall_short_though_each_could_by_chance() -> None:
    assert missed({"a": row(93, 100), "b": row(93, 100)}) == ["all: 0.930 held the surface, not 0.95"]


def test_where_nothing_was_answered_nothing_is_shown() -> None:
    assert missed({}) == ["all: nan held the surface, not 0.95"]


@pytest.mark.parametrize(("off_mm", "code"), [(0.0, 0), (0.5, 1)])
def test_the_command_ends_with_1_where_a_surface_is_planted_elsewhere(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], off_mm: float, code: int
) -> None:
    monkeypatch.setattr(preload, "SURFACE_MM", SURFACE_MM + off_mm)
    monkeypatch.setattr("sys.argv", ["preload", "--loadings", "1", "--strokes", "3 mm of air"])
    assert preload.main() == code
    assert np.isfinite([one["share"] for one in json.loads(capsys.readouterr().out.splitlines()[-1]).values()]).all()
