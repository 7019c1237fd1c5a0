"""Presses of a glove: found in forces, refused for what is wrong with them, and the value that three of them give."""

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.experiments.presses import MOST, SPREAD, GlovePress, PressFinder, gathered, judged, threshold_N

PERIOD_NS = 20_000_000
Forces = list[float | None]


def pressed(peak_N: float, samples: int = 40) -> Forces:
    """Rises straight, and is let go at once."""
    return [*(peak_N * number / samples for number in range(1, samples + 1)), *[0.0] * 10]


def seen(*presses: Forces) -> list[GlovePress]:
    finder = PressFinder()
    forces = [force_N for press in presses for force_N in press]
    found = (finder.update(number * PERIOD_NS, force_N) for number, force_N in enumerate(forces))
    return [press for press in found if press]


def stream(*presses: Forces) -> Iterator[tuple[int, float | None]]:
    forces = [force_N for press in presses for force_N in press]
    yield from ((number * PERIOD_NS, force_N) for number, force_N in enumerate(forces))


def test_a_press_is_its_peak_and_how_long_it_took() -> None:
    (found,) = seen(pressed(8.0))
    # It counts from 1 N on, the fifth sample of 0.2 N steps, to the first below 0.5 N, the 41st.
    assert (found.peak_N, found.refused) == (8.0, "")
    assert found.seconds == pytest.approx(36 * 0.02)


def test_below_a_newton_nobody_presses() -> None:
    assert seen(pressed(0.9), pressed(0.99)) == []


def test_wavering_about_a_newton_is_one_press() -> None:
    (found,) = seen([1.2, 0.8, 1.4, 0.7, 3.0, *[2.0] * 20, 0.0])
    assert found.peak_N == 3.0


def test_a_knock_is_refused() -> None:
    (found,) = seen(pressed(8.0, samples=10))
    assert "too short, 0.18 s (at least 0.3 s): a knock" in found.refused


def test_a_press_in_which_a_finger_was_not_known_is_refused() -> None:
    forces = pressed(8.0)
    (found,) = seen([*forces[:30], None, *forces[30:]])
    assert "beyond the heaviest weight of its calibration" in found.refused
    assert seen([None] * 20) == []


def test_three_that_agree_give_their_median_and_no_more_are_asked_for() -> None:
    all_of_them = list(gathered(stream(pressed(8.0), pressed(9.0), pressed(8.4), pressed(30.0))))
    assert [len(presses) for presses in all_of_them] == [1, 2, 3]
    assert threshold_N(all_of_them[-1]) == 8.4
    assert threshold_N(all_of_them[-2]) is None


def test_the_one_that_lies_apart_is_refused_and_repeated() -> None:
    presses = list(gathered(stream(pressed(8.0), pressed(8.4), pressed(13.0), pressed(8.2), pressed(99.0))))[-1]
    assert [bool(press.refused) for press in presses] == [False, False, True, False]
    assert "55% off the median of 8.4 N (at most 25%): repeated" in presses[2].refused
    assert threshold_N(presses) == 8.2


@pytest.mark.parametrize(("third_N", "kept"), [(10.0, True), (10.001, False), (6.0, True), (5.999, False)])
def test_a_quarter_off_the_median_is_still_the_same_and_more_is_not(third_N: float, kept: bool) -> None:
    found = judged([GlovePress(8.0, 1.0), GlovePress(8.0, 1.0), GlovePress(third_N, 1.0)])
    assert (not found[-1].refused) is kept


def test_presses_that_never_agree_come_to_an_end() -> None:
    peaks_N = [2.0 * 2**number for number in range(12)]
    presses = list(gathered(stream(*(pressed(peak_N) for peak_N in peaks_N))))[-1]
    assert len(presses) == MOST
    assert threshold_N(presses) is None


@given(st.lists(st.floats(1.0, 40.0), min_size=3, max_size=MOST))
def test_whatever_is_pressed_those_that_count_agree(peaks_N: list[float]) -> None:
    presses: tuple[GlovePress, ...] = ()
    for peak_N in peaks_N:
        presses = judged((*presses, GlovePress(peak_N, 1.0)))
        value_N = threshold_N(presses)
        if value_N is not None:
            counted = [press.peak_N for press in presses if not press.refused]
            assert len(counted) == 3
            assert all(abs(one - value_N) <= SPREAD * value_N for one in counted)
            return
