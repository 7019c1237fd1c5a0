"""Frames without numbers: dated by their place in the stream, whatever is late, damaged or lost."""

import random
from collections.abc import Callable, Mapping
from typing import NamedTuple

import pytest

from drivers.robotiq.codec import FRAME_BYTES, FRAME_NS
from drivers.robotiq.frame_clock import LISTEN_NS, FrameClock

MS = 1_000_000
EPOCH_NS = 10**12


class Frame(NamedTuple):
    """When it was sampled, and its error of capture [ms]."""

    number: int
    error_ms: float


Delay = Callable[[int, random.Random], int]


def quick(_: int, rng: random.Random) -> int:
    return round(rng.expovariate(1 / (0.1 * MS)))


def loaded(_: int, rng: random.Random) -> int:
    return quick(0, rng) if rng.random() < 1 / 3 else rng.randrange(9 * MS)


def adapter(since_ns: int, _: random.Random) -> int:
    """A USB adapter that hands over what it has every 16 ms."""
    return -since_ns % (16 * MS)


def stalls(since_ns: int, rng: random.Random) -> int:
    """Every 0.7 s the host stands still for 41 ms."""
    return max(41 * MS - since_ns % (700 * MS), 0) or quick(0, rng)


def played(
    clock: FrameClock,
    delay: Delay = quick,
    frames: int = 3000,
    off_ppm: float = 0.0,
    lost: Mapping[int, int] | None = None,
    garbage: Mapping[int, int] | None = None,
) -> list[Frame]:
    """Plays a stream; ``lost`` maps a frame that never comes to how many of its bytes do, ``garbage`` adds bytes."""
    rng, lost, garbage = random.Random(1), lost or {}, garbage or {}
    period_ns = 10 * MS * (1 + off_ppm * 1e-6)
    reads: list[tuple[int, list[int], list[int]]] = []
    gap = 0
    for number in range(frames):
        since_ns = round(number * period_ns)
        gap += garbage.get(number, 0)
        if number in lost:
            gap += lost[number]
            continue
        ready_ns = EPOCH_NS + since_ns + FRAME_NS + delay(since_ns, rng)
        if reads and ready_ns <= reads[-1][0]:
            reads[-1][1].append(number)
            reads[-1][2].append(gap)
        else:
            reads.append((ready_ns, [number], [gap]))
        gap = 0
    dated = []
    for arrival_ns, numbers, gaps in reads:
        devices_ns = clock.take(gaps, arrival_ns)
        if arrival_ns < EPOCH_NS + LISTEN_NS:
            continue
        for number, capture_ns in zip(numbers, clock.captures(devices_ns, arrival_ns), strict=True):
            dated.append(Frame(number, (capture_ns - EPOCH_NS - number * period_ns) / MS))
    return dated


def worst(dated: list[Frame], share: float = 1.0) -> float:
    errors = sorted(abs(frame.error_ms) for frame in dated)
    return errors[int(share * (len(errors) - 1))]


@pytest.mark.parametrize("off_ppm", [0, 100, -100, 2_000, -2_000, 15_000, -15_000])
@pytest.mark.parametrize("delay", [quick, loaded, stalls])
def test_frames_are_dated_to_a_fifth_of_a_millisecond(delay: Delay, off_ppm: float) -> None:
    clock = FrameClock(0)
    assert worst(played(clock, delay, off_ppm=off_ppm), 0.99) < 0.2
    assert clock.lost == 0


def test_a_late_frame_is_not_recorded_late() -> None:
    dated = played(FrameClock(0), lambda since_ns, rng: 41 * MS if since_ns == 20_000 * MS else quick(since_ns, rng))
    assert worst(dated) < 0.3


def test_an_adapter_that_collects_bytes_loses_no_frames() -> None:
    """It makes frames up to 16 ms late, in a beat of which the map still finds the quickest to an eighth."""
    clock = FrameClock(0)
    assert worst(played(clock, adapter, off_ppm=100), 0.99) < 2
    assert clock.lost == 0


@pytest.mark.parametrize("left", [FRAME_BYTES, 9, 1])
def test_frames_of_which_bytes_are_left_keep_their_places_at_once(left: int) -> None:
    clock = FrameClock(0)
    assert worst(played(clock, lost={500: left, 1000: FRAME_BYTES, 1001: FRAME_BYTES, 1002: left})) < 0.3
    assert clock.lost == 4


@pytest.mark.parametrize("count", [1, 2, 40])
def test_frames_lost_without_a_trace_are_found_within_ten(count: int) -> None:
    clock = FrameClock(0)
    dated = played(clock, lost=dict.fromkeys(range(1000, 1000 + count), 0))
    assert clock.lost == count
    assert worst([frame for frame in dated if not 1000 <= frame.number < 1010 + count]) < 0.3


def test_bytes_that_are_no_frames_move_nothing() -> None:
    clock = FrameClock(0)
    assert worst(played(clock, garbage={500: 23, 900: 40, 1400: 7})) < 0.3
    assert clock.lost == 0


def test_garbage_before_a_late_frame_is_taken_back_when_the_next_is_in_time() -> None:
    clock = FrameClock(0)
    late = 10_000 * MS
    dated = played(
        clock, lambda since_ns, rng: 12 * MS if since_ns == late else quick(since_ns, rng), garbage={1000: 23}
    )
    assert worst([frame for frame in dated if frame.number not in (1000, 1001)]) < 0.3
    assert clock.lost == 0


def test_what_an_unread_line_dropped_is_known_at_the_second_read() -> None:
    """For 10 s nobody reads; the kernel kept the first 255 frames, the rest is gone."""
    clock = FrameClock(0)

    def pause(since_ns: int, rng: random.Random) -> int:
        return 20_000 * MS - since_ns if 10_000 * MS <= since_ns < 20_000 * MS else quick(since_ns, rng)

    dated = played(clock, pause, lost=dict.fromkeys(range(1255, 2000), 0))
    assert clock.lost == 745
    assert worst([frame for frame in dated if frame.number != 2000]) < 0.3


def test_a_new_stream_begins_anew() -> None:
    clock = FrameClock(0)
    played(clock, frames=200)
    clock.restart()
    assert clock.take([0], EPOCH_NS * 2) == [0]
