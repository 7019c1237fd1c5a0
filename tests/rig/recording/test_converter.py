"""Steps and ends of a converter's range, on signals of which it is known by how they were made."""

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.recording.converter import at_the_end_of_range, ends_of_range, resolution
from tests.data import recording

Column = NDArray[np.float64]
TIME_S: Column = np.asarray(np.arange(4000) * 1e-3, np.float64)
STEP_N = 0.002


def counted(force_N: Column, noise_N: float = 0.0, seed: int = 5) -> Column:
    """The force with noise, in steps of a converter."""
    noisy = force_N + noise_N * np.random.default_rng(seed).standard_normal(len(force_N))
    return np.asarray(STEP_N * np.round(noisy / STEP_N))


def stroke(turn_s: float = 2.0, hold_s: float = 0.0) -> Column:
    """8 mm in, held, and out again, at one speed."""
    way_mm = np.interp(TIME_S, [0.2, turn_s - hold_s / 2, turn_s + hold_s / 2, 3.8], [0.0, 8.0, 8.0, 0.0])
    return np.asarray(way_mm)


def elastic(place_mm: Column) -> Column:
    return np.asarray(0.3 * np.maximum(place_mm - 1.0, 0.0) ** 1.5)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("ripple_N", [0.002, 0.004])
def test_a_clipped_force_is_full_whatever_ripple_its_converter_adds(sign: float, ripple_N: float) -> None:
    place_mm = stroke()
    force_N = elastic(place_mm)
    full = at_the_end_of_range(sign * counted(np.minimum(force_N, 3.0), ripple_N), place_mm)
    # Within the ripple of the end the ramp is no less full than the rest.
    assert full[force_N > 3.0].all()
    assert not full[force_N < 2.9].any()


def test_a_wrong_sample_does_not_end_what_is_full() -> None:
    place_mm = stroke()
    force_N = np.minimum(elastic(place_mm), 3.0)
    late = (TIME_S > 2.4) & (elastic(place_mm) > 3.0)
    assert late.any()
    force_N[np.argmax(late)] = 2.5
    assert at_the_end_of_range(counted(force_N, 0.004), place_mm)[late].all()


def test_a_force_that_stands_while_a_tip_that_stood_goes_back_is_full() -> None:
    place_mm = stroke(hold_s=0.5)
    force_N = 4.0 * elastic(place_mm) / elastic(place_mm).max()
    force_N[(TIME_S > 1.75) & (TIME_S < 3.0)] = 4.0
    assert at_the_end_of_range(counted(force_N, 0.004), place_mm)[(TIME_S > 1.8) & (TIME_S < 2.95)].all()


def pressed(seed: int, clipped_N: float = 10.0) -> tuple[Column, Column]:
    """Rest, approach, a press to 1.6 N and back into the air, as a bench records it with its sensor's zero at 0.8 N."""
    random, speed_mm_s = np.random.default_rng(seed), [0, 0, 15, 15, 0, 0, -20, -20, 0, 0]
    place_mm = 0.001 * np.cumsum(np.interp(TIME_S, [0, 0.46, 0.5, 0.8, 0.84, 1.2, 1.24, 1.6, 1.64, 4], speed_mm_s))
    force_N = 1.6 * np.expm1(0.3 * np.maximum(place_mm - 3.5, 0.0)) / np.expm1(0.3 * (place_mm.max() - 3.5))
    read_N = 0.8 - force_N + random.normal(0, 0.005, len(TIME_S))
    return np.round(np.maximum(read_N, 0.8 - clipped_N), 3), place_mm + random.normal(0, 0.0002, len(TIME_S))


def test_the_air_that_a_tip_leaves_and_comes_back_to_is_no_end_of_range() -> None:
    assert [seed for seed in range(100) if at_the_end_of_range(*pressed(seed)).any()] == []


def test_a_soft_press_beyond_its_load_cell_is_full() -> None:
    assert all(at_the_end_of_range(*pressed(seed, 0.8)).any() for seed in range(100))


@pytest.mark.parametrize("noise_N", [0.002, 0.004, 0.02])
def test_a_hold_without_relaxation_is_not_full(noise_N: float) -> None:
    place_mm = stroke(hold_s=1.0)
    encoder_mm = place_mm + 0.0005 * np.random.default_rng(2).standard_normal(len(place_mm))
    assert not at_the_end_of_range(counted(elastic(place_mm), noise_N), encoder_mm).any()


@pytest.mark.parametrize("lag_s", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("noise_N", [0.0, 0.002])
def test_a_smooth_peak_is_not_full_however_late_the_force(lag_s: float, noise_N: float) -> None:
    place_mm = 4.0 - 4.0 * np.cos(2 * np.pi * TIME_S / 4)
    force_N = 6.0 - 6.0 * np.cos(2 * np.pi * (TIME_S + lag_s) / 4)
    assert not at_the_end_of_range(counted(np.asarray(force_N), noise_N), np.asarray(place_mm)).any()


def test_a_drive_that_takes_up_its_lost_motion_at_the_turn_leaves_no_end_of_range() -> None:
    encoder_mm = stroke()
    lost_mm = 0.7
    tip_mm = np.where(TIME_S < 2.0, encoder_mm, np.minimum(8.0, encoder_mm + lost_mm))
    assert not at_the_end_of_range(counted(elastic(tip_mm), 0.002), encoder_mm).any()


def test_without_the_way_a_ripple_tells_nothing() -> None:
    assert not at_the_end_of_range(counted(np.minimum(elastic(stroke()), 3.0), 0.002)).any()


def test_the_ends_are_those_of_the_range() -> None:
    swing = np.clip(8 * np.sin(2 * np.pi * TIME_S), -7, 7)
    assert ends_of_range(swing, np.abs(swing) == 7) == (-7.0, 7.0)
    assert ends_of_range(swing, swing == 7) == (7.0,)
    assert ends_of_range(swing, swing == -7) == (-7.0,)
    assert ends_of_range(swing, swing > 9) == ()


@pytest.mark.parametrize("step", [0.001, 0.0035, 35.15065188 / 4096, 3e-6])
@pytest.mark.parametrize("offset", [0.0, 123.4567])
def test_the_step_of_a_converter_is_found_whatever_its_unit_and_zero(step: float, offset: float) -> None:
    counts = np.random.default_rng(3).integers(-3000, 3000, 500) * 3 + 7
    assert resolution((step * counts + offset).astype(np.float64)) == pytest.approx(3 * step, rel=1e-4)


def test_few_values_far_apart_have_the_step_that_divides_all_their_differences() -> None:
    assert resolution(np.array([0.0, 0.6, 1.5, 2.1])) == pytest.approx(0.3)


@pytest.mark.parametrize("values", [np.random.default_rng(2).standard_normal(5000), np.ones(9), np.array([])])
def test_values_without_a_common_step_have_none(values: Column) -> None:
    assert resolution(values) == 0.0


def test_wells_pressed_beyond_their_load_cell_are_full_and_no_others() -> None:
    found = dict[str, bool]()
    for path in recording("asmi").glob("run_*/well_[A-C]*.csv"):
        place_mm, force_N = np.loadtxt(path, delimiter=",", skiprows=11, usecols=(1, 2)).T
        full = at_the_end_of_range(force_N, place_mm)
        # The cell ends at 65.96 N, give or take a few of its steps of 2 mN.
        assert full.any() == (np.count_nonzero(force_N < -65.9) >= 8)
        assert (force_N[full] < -65.9).all()
        found[f"{path.parent.name} {path.name}"] = bool(full.any())
    assert sum(found.values()) == 5
