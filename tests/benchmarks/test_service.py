"""The verdict on the service under load: met by good figures, and missed by each bad one alone."""

import json

import pytest

from benchmarks.service import __main__ as service
from benchmarks.service.__main__ import Memory, goals_missed

# As measured on a quiet computer, and each at its bound.
GOOD = {
    "served_per_s": 190.0, "lost_samples": 0, "missed_percent": 0.25, "missed_percent_idle": 0.15,
    "stop_p99_ms": 19.9, "rss_growth_MB": 19.9,
}  # fmt: skip
BAD = [
    ("served_per_s", 189.0), ("lost_samples", 1), ("missed_percent", 0.27), ("stop_p99_ms", 20.0),
    ("rss_growth_MB", 20.0), ("stop_p99_ms", float("nan")), ("rss_growth_MB", float("nan")),
    ("missed_percent", float("nan")), ("served_per_s", float("nan")),
]  # fmt: skip


def ended(found: dict[str, float], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """What the command prints of such figures; its exit code comes first."""
    monkeypatch.setattr(service, "measured", lambda _minutes, _presses: found)
    monkeypatch.setattr("sys.argv", ["benchmarks.service"])
    return [str(service.main()), *capsys.readouterr().out.splitlines()]


def test_good_figures_end_with_nothing_missed_and_the_figures_as_the_last_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, last = ended(GOOD, monkeypatch, capsys)
    assert (code, said, json.loads(last)) == ("0", "goals missed: none", GOOD)


@pytest.mark.parametrize(("name", "planted"), BAD)
def test_each_bad_figure_alone_is_named_and_ends_the_command_with_1(
    name: str, planted: float, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, _ = ended(GOOD | {name: planted}, monkeypatch, capsys)
    assert (code, said) == ("1", f"goals missed: {name}")


def test_what_the_idle_run_misses_too_is_not_the_loads() -> None:
    assert goals_missed(GOOD | {"missed_percent": 5.0, "missed_percent_idle": 4.95}) == []


def test_memory_grows_from_the_end_of_the_first_minute_whatever_came_before() -> None:
    memory = Memory(0)
    memory.seen = [(2.0 * turn, 100.0 if turn < 20 else 300.0 + 0.01 * turn) for turn in range(300)]
    assert memory.growth_MB(600.0) == pytest.approx(0.01 * (285.0 - 30.0), abs=0.05)
