"""What is counted of a stream, on streams of which it is known by how they were made."""

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.recording.converter import at_the_end_of_range, resolution
from rig.trials.findings import inspect_stream
from rig.trials.streams import longest_repeat, sampling_of, sign_bit

Column = NDArray[np.float64]
TIME_S: Column = np.asarray(np.arange(4000) * 1e-3, np.float64)


def press(noise_N: float = 0.01, step_N: float = 0.001, seed: int = 5) -> Column:
    """Air, a ramp to 6 N, a hold and the way back, with noise, in steps of a converter; shape (4000,)."""
    force_N = np.interp(TIME_S, [0, 1, 2, 3, 4], [0.2, 0.2, 6.2, 6.2, 0.2])
    force_N = force_N + noise_N * np.random.default_rng(seed).standard_normal(len(TIME_S))
    return np.asarray(step_N * np.round(force_N / step_N)) if step_N else force_N


def kinds(value: Column, time_s: Column = TIME_S) -> dict[str, str]:
    return {found.kind: found.text for found in inspect_stream("a", "force", time_s, value)}


def test_a_good_stream_has_no_finding() -> None:
    assert kinds(press()) == {}


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_force_cut_off_at_either_end_is_full_there_and_nowhere_else(sign: float) -> None:
    clipped = sign * np.minimum(press(), 5.0)
    assert np.array_equal(at_the_end_of_range(clipped), press() >= 5.0)
    count = int(np.count_nonzero(press() >= 5.0))
    assert kinds(clipped) == {
        "saturation": f"force: {count} samples stand at the end of its range, {5 * sign:g}; not judged there"
    }


def test_both_ends_are_seen_at_once() -> None:
    swing = 8 * np.sin(2 * np.pi * TIME_S) + 0.01 * np.random.default_rng(1).standard_normal(len(TIME_S))
    assert np.array_equal(at_the_end_of_range(np.clip(swing, -7, 7)), np.abs(swing) >= 7)


def test_a_peak_that_is_held_is_no_end_of_range() -> None:
    assert not at_the_end_of_range(press()).any()
    assert not at_the_end_of_range(press(noise_N=0.0, step_N=0.1)).any(), "a coarse sensor stands still in the hold"
    assert not at_the_end_of_range(np.maximum(press(), 0.2)).any(), "where it starts is where it rests"


def test_a_coarse_force_says_its_step_and_how_few_there_are() -> None:
    coarse = press(step_N=0.25)
    assert resolution(coarse) == pytest.approx(0.25)
    assert kinds(coarse)["quantisation"] == f"force: only {np.ptp(coarse) / 0.25:.0f} steps of 0.25 over its range"


def test_dropped_frames_are_gaps_with_their_length() -> None:
    kept = np.ones(len(TIME_S), bool)
    kept[1000:1040] = kept[3000:3006] = False
    clock = sampling_of(TIME_S[kept])
    assert (clock.gaps, clock.lost) == (2, 0)
    assert (clock.period_s, clock.longest_s) == pytest.approx((0.001, 0.041))
    assert kinds(press()[kept], TIME_S[kept]) == {"gap": "force: 2 gaps, the longest 41 ms at 1000 Hz"}


def test_repeated_times_are_lost_and_the_first_is_named() -> None:
    time_s = TIME_S.copy()
    time_s[10], time_s[500:503] = time_s[9], time_s[499]
    assert sampling_of(time_s)[4:] == (4, 11)
    said = "force: time stands still or runs backwards, first at sample 11; 4 of 4000 samples left out"
    assert kinds(press(), time_s) == {"clock": said}


def test_a_constant_channel_carries_nothing() -> None:
    assert kinds(np.full(len(TIME_S), 0.5)) == {"constant": "force: constant at 0.5: the stream carries nothing"}


def test_a_value_that_stands_is_counted() -> None:
    force_N = press()
    force_N[1200:1600] = force_N[1200]
    assert longest_repeat(force_N) == 400
    assert kinds(force_N) == {"frozen": "force: the value does not change for 399 ms"}


@pytest.mark.parametrize("bit", [10, 15])
@pytest.mark.parametrize("step", [1.0, 0.1])
def test_a_sign_in_a_high_bit_is_seen_and_named(bit: int, step: float) -> None:
    signed = np.round(300 * np.sin(2 * np.pi * TIME_S) + np.random.default_rng(4).normal(0, 5, len(TIME_S)))
    counts = np.where(signed < 0, (1 << bit) - signed, signed)
    assert sign_bit(step * counts, step) == bit
    assert kinds(step * counts)["sign_bit"].startswith(f"force: values jump by {step * 2**bit:g} as if")


@pytest.mark.parametrize(
    "counts",
    [
        1024 + np.round(30 * np.sin(TIME_S * 9)),  # passes the bit itself
        np.round(np.interp(TIME_S, [0, 1, 2, 3, 4], [0, 0, 1500, 1500, 0])),  # one press over it
        np.round(2000 * np.abs(np.sin(TIME_S * 9))),
        np.where(TIME_S % 1 < 0.5, 0.0, 1500.0),  # switches on and off
        np.round(300 * np.sin(TIME_S * 9)),  # has its own sign
    ],
)
def test_numbers_that_pass_a_power_of_two_have_no_sign_bit(counts: Column) -> None:
    assert sign_bit(counts, 1.0) is None
