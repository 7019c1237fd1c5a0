"""Which SYNC an answer belongs to, what is lost, and samples with contiguous numbers."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from drivers.epos4.kind import Epos4Kind
from drivers.epos4.samples import SUSPICIONS, SampleBuilder, SyncMatcher
from rig.config.products.maxon_epos4 import Epos4Wiring

MS = 1_000_000
STATE = bytes.fromhex("37 16 20 4E 00 00")
MOTION = bytes.fromhex("3C 00 00 00 F4 01 00 00")


def test_a_sample_has_the_time_of_its_sync_and_of_its_arrival() -> None:
    builder = SampleBuilder(Epos4Kind(Epos4Wiring()))
    builder.matcher.sent(5 * MS)
    builder.take_state(STATE, 6 * MS)
    assert builder.collect() == []
    builder.take_motion(MOTION, 6 * MS)
    [sample] = builder.collect()
    assert sample == (0, 5 * MS, 6 * MS, 10.0, 5.0, 0.5, 0x1637, 1)
    assert builder.collect() == []


def test_a_drive_in_fault_gives_samples_that_are_not_valid() -> None:
    builder = SampleBuilder(Epos4Kind(Epos4Wiring()))
    builder.matcher.sent(5 * MS)
    builder.take_state(bytes.fromhex("18 02 20 4E 00 00"), 6 * MS)
    builder.take_motion(MOTION, 6 * MS)
    assert [sample.valid for sample in builder.collect()] == [0]


def test_a_sync_of_which_one_answer_is_missing_counts_as_lost() -> None:
    builder = SampleBuilder(Epos4Kind(Epos4Wiring()))
    for sync_ms in (0, 1, 2):
        builder.matcher.sent(sync_ms * MS)
    builder.take_state(STATE, 3 * MS)
    builder.take_state(STATE, 3 * MS)
    builder.take_motion(MOTION, 3 * MS)
    builder.take_motion(MOTION, 3 * MS)
    assert [(sample.seq, sample.capture_ns) for sample in builder.collect()] == [(0, 1 * MS)]
    assert builder.matcher.lost == 2


def test_answers_nobody_asked_for_and_of_wrong_length_make_no_sample() -> None:
    builder = SampleBuilder(Epos4Kind(Epos4Wiring()))
    builder.take_state(STATE, 0)
    builder.take_motion(MOTION, 0)
    builder.matcher.sent(MS)
    builder.take_state(STATE[:5], 2 * MS)
    builder.take_motion(MOTION, 2 * MS)
    assert builder.collect() == []
    assert builder.matcher.lost == 1


def test_a_sync_without_answer_is_given_up_after_a_quarter_of_a_second() -> None:
    matcher = SyncMatcher()
    matcher.sent(0)
    matcher.sent(240 * MS)
    assert matcher.lost == 0
    matcher.sent(260 * MS)
    assert matcher.lost == 1
    assert matcher.answered(261 * MS) == 240 * MS


def test_after_a_loss_the_times_are_right_again_within_fifty_samples() -> None:
    matcher = SyncMatcher()
    captures = []
    for tick in range(200):
        if tick:
            answer_lost = tick - 1 == 100
            captures.append(None if answer_lost else matcher.answered(tick * MS - MS // 2))
        matcher.sent(tick * MS)
    right = [tick for tick, capture in enumerate(captures) if capture == tick * MS]
    assert right[:100] == list(range(100))
    assert right[100] == 100 + SUSPICIONS
    assert matcher.lost == 1


@given(delays_us=st.lists(st.integers(100, 900), min_size=100, max_size=300))
def test_late_answers_alone_are_never_taken_for_a_loss(delays_us: list[int]) -> None:
    matcher = SyncMatcher()
    due: list[tuple[int, int]] = []
    arrival_ns = 0
    for tick, delay_us in enumerate(delays_us):
        now_ns = tick * MS
        while due and due[0][0] <= now_ns:
            arrival_ns, sync_ns = due.pop(0)
            assert matcher.answered(arrival_ns) == sync_ns
        matcher.sent(now_ns)
        stall_us = 3000 if tick % 40 == 39 else 0
        due.append((max(now_ns + (delay_us + stall_us) * 1000, arrival_ns), now_ns))
    assert matcher.lost == 0


@given(events=st.lists(st.sampled_from("sma"), max_size=200))
def test_numbers_are_contiguous_and_times_never_go_back_whatever_comes(events: list[str]) -> None:
    builder = SampleBuilder(Epos4Kind(Epos4Wiring()))
    for tick, event in enumerate(events):
        if event == "s":
            builder.matcher.sent(tick * MS)
        elif event == "a":
            builder.take_state(STATE, tick * MS)
        else:
            builder.take_motion(MOTION, tick * MS)
    samples = builder.collect()
    assert [sample.seq for sample in samples] == list(range(len(samples)))
    assert all(first.capture_ns < second.capture_ns for first, second in pairwise(samples))
    assert all(sample.capture_ns <= sample.arrival_ns for sample in samples)
    assert builder.matcher.lost + len(samples) <= events.count("s")
