"""The verdict on the service under load: met by good figures, and missed by each bad one alone."""

import json
import struct

import pytest

from benchmarks.service import __main__ as service
from benchmarks.service.__main__ import Memory, goals_missed
from benchmarks.service.clients import Numbers

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


def batch(seq: int, covered: int, channel: int = 1) -> bytes:
    """The head of one without rows, as docs/api/streams.md has it."""
    return struct.pack("<HHIqII", channel, 1, seq, 0, 0, covered)


def lost_of(*messages: str | bytes) -> int:
    numbers = Numbers()
    channels = [{"channel": 1, "step": 2}, {"channel": 2, "step": 1}]
    numbers.take(json.dumps({"type": "subscribed", "channels": channels}))
    return sum(numbers.take(message)[1] for message in messages)


GAP = json.dumps({"type": "gap", "channel": 1, "from": 106, "to": 110, "dropped": 3})


@pytest.mark.parametrize(
    ("messages", "lost"),
    [
        ((batch(100, 3) + batch(5, 1, 2), batch(106, 1) + batch(6, 4, 2)), 0),
        ((batch(100, 3), batch(108, 1)), 1),
        ((batch(100, 3), GAP, batch(112, 1)), 3),
        ((batch(100, 3), GAP, batch(114, 1)), 4),
        ((batch(2**32 - 2, 1), batch(0, 1)), 0),
        ((batch(100, 3), json.dumps({"type": "run", "run": "b"}), batch(0, 1)), 0),
        ((batch(100, 3), batch(100, 3)), 2**31 - 3),
        ((batch(5, 1, 2), batch(7, 1, 2), json.dumps({"type": "ping"})), 1),
    ],
)
def test_what_neither_a_batch_nor_a_gap_accounts_for_is_lost(messages: tuple[str | bytes, ...], lost: int) -> None:
    assert lost_of(*messages) == lost


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
