"""Decimation against a plain count in Python: each sample in one part, each part's ends those of its samples."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from api.http.streams import batch
from api.http.streams.history import LiveHistory, Rows, row_type
from api.http.streams.signals import signals
from api.http.streams.views import View, unbroken
from rig.config.wiring import Wiring

FORCE = signals(Wiring())["compression"]
MS = 1_000_000


def rows(values: list[float], times_ms: list[int] | None = None, first_seq: int = 0) -> Rows:
    made = np.zeros(len(values), row_type(["compression_N"]))
    made["seq"] = np.arange(first_seq, first_seq + len(values))
    made["time_ns"] = [time * MS for time in times_ms or range(len(values))]
    made["compression_N"] = values
    return made


def plain(values: list[float], times_ms: list[int], width_ns: int) -> list[tuple[float, float]]:
    """(smallest, largest) of each part, by a loop."""
    found = dict[int, list[float]]()
    for value, time_ms in zip(values, times_ms, strict=True):
        found.setdefault(time_ms * MS // width_ns, []).append(value)
    return [(min(part), max(part)) for part in found.values()]


@given(
    values=st.lists(st.floats(-50, 50, width=32), min_size=1, max_size=300),
    gaps_ms=st.lists(st.integers(0, 40), min_size=300, max_size=300),
    rate_hz=st.floats(1.0, 2000.0),
)
@settings(max_examples=150, deadline=None)
def test_each_part_has_the_ends_of_its_samples(values: list[float], gaps_ms: list[int], rate_hz: float) -> None:
    times_ms = np.cumsum(gaps_ms[: len(values)]).tolist()
    view = View(1, FORCE, rate_hz, "minmax")
    history = LiveHistory(["compression_N"], 1000.0)
    history.add(rows(values, times_ms))
    place, seen, covered = 0, list[tuple[float, float]](), 0
    while cut := view.cut(history, place, now_ns=10**15):
        channel, columns, seq, _, n, count = batch.HEADER.unpack_from(cut.data)
        assert (channel, columns, seq) == (1, 2, place)
        ends = np.frombuffer(cut.data, "<f4", offset=batch.HEADER.size + 4 * n).reshape(2, n)
        seen += list(zip(*ends.tolist(), strict=True))
        covered, place = covered + count, cut.following
    assert covered == len(values)
    # A batch ends after two seconds, be it within a part.
    expected = plain(values, times_ms, view.width_ns)
    assert len(expected) <= len(seen) <= len(expected) + times_ms[-1] // 1900
    assert max(high for _, high in seen) == max(values) and min(low for low, _ in seen) == min(values)
    if len(seen) == len(expected):
        assert seen == expected


def test_a_part_is_sent_once_no_sample_can_come_any_more() -> None:
    view, history = View(1, FORCE, 10.0, "minmax"), LiveHistory(["compression_N"], 1000.0)
    history.add(rows([1.0] * 250))
    whole = view.cut(history, 0, now_ns=250 * MS)
    assert whole and whole.following == 200
    assert view.cut(history, 200, now_ns=251 * MS) is None
    # Its part ends at 300 ms; a sample may come 200 ms late.
    assert view.cut(history, 200, now_ns=499 * MS) is None
    late = view.cut(history, 200, now_ns=500 * MS)
    assert late and (late.first_seq, late.last_seq) == (200, 249)


def test_what_is_not_known_hides_no_peak_and_alone_is_not_known() -> None:
    view, history = View(1, FORCE, 10.0, "minmax"), LiveHistory(["compression_N"], 1000.0)
    history.add(rows([math.nan] * 50 + [7.0] + [math.nan] * 149))
    cut = view.cut(history, 0, now_ns=10**12)
    assert cut
    ends = np.frombuffer(cut.data, "<f4", offset=batch.HEADER.size + 8).reshape(2, 2)
    assert ends[:, 0].tolist() == [7.0, 7.0] and np.isnan(ends[:, 1]).all()


def test_a_batch_holds_no_jump_in_numbers_and_no_time_beyond_its_range() -> None:
    jumped = np.concatenate([rows([1.0] * 10), rows([1.0] * 10, list(range(10, 20)), first_seq=15)])
    assert unbroken(jumped, 1) == (10, True)
    far = rows([1.0] * 4, [0, 1, 2, 2000])
    assert unbroken(far, 1) == (3, False)
    assert unbroken(rows([1.0] * 4, [0, 1, 2, 1999]), 1) == (4, False)


def test_sequence_numbers_go_round_after_32_bits() -> None:
    history = LiveHistory(["compression_N"], 1000.0)
    history.add(rows([1.0, 2.0], first_seq=2**32 + 5))
    cut = View(1, FORCE, 0.0, "none").cut(history, 0, 0)
    assert cut and batch.HEADER.unpack_from(cut.data)[2] == 5


def test_one_encoding_serves_all_clients_of_a_view() -> None:
    history = LiveHistory(["compression_N"], 1000.0)
    history.add(rows([1.0] * 100))
    view = View(1, FORCE, 0.0, "none")
    first, second = view.cut(history, 0, 5), view.cut(history, 0, 5)
    assert first is second
    history.add(rows([2.0], first_seq=100))
    third = view.cut(history, 0, 5)
    assert third and third.last_seq == 100


def test_the_history_keeps_a_minute_of_the_fastest_sensor_and_no_more() -> None:
    history = LiveHistory(["compression_N"], 1000.0)
    for start in range(0, 100_000, 7000):
        history.add(rows([float(start)] * 7000, list(range(start, start + 7000)), start))
    assert 60_000 * 1.01 <= history.end - history.start < 70_000
    kept = history.between(history.start, history.end)
    assert kept["seq"].tolist() == list(range(history.start, history.end))
    assert history.after_seq(99_000) == 99_001
    assert history.after_ns(99_000 * MS) == 99_001
    assert history.after_seq(10**9) == history.end and history.after_seq(-1) == history.start


@pytest.mark.parametrize(
    ("decimation", "columns"), [("none", ["x_mm", "y_mm", "z_mm"]), ("last", ["x_mm", "y_mm", "z_mm"])]
)
def test_columns_are_named_as_their_fields(decimation: batch.Decimation, columns: list[str]) -> None:
    assert View(1, signals(Wiring())["marker"], 5.0, decimation).columns == columns
    ends = View(1, signals(Wiring())["marker"], 5.0, "minmax").columns
    assert ends == ["x_mm.min", "x_mm.max", "y_mm.min", "y_mm.max", "z_mm.min", "z_mm.max"]
