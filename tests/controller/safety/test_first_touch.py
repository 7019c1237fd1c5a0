"""The first touch of a program: a sensor that answers otherwise than it was calibrated is found out at about 1 N."""

from dataclasses import replace

import pytest

from controller.loop.modes import Mode
from controller.loop.state import LoopState
from controller.loop.steps import Compress, Retract
from controller.safety.first_touch import FirstTouch
from controller.safety.load import Wrench
from controller.safety.table import TABLE
from tests.controller.fake_bench import wired
from tests.controller.plant_bench import BOTA, FT300, PRODUCTS, TOUCH, PlantBench, Product, linear

TRIAL = (
    *TOUCH,
    Compress(depth_mm=3.0, speed_mm_s=20.0, force_limit_N=12.0),
    Retract(clearance_mm=5.0, speed_mm_s=10.0),
)
WITHOUT = tuple(line for line in TABLE if line.code != "first_touch")


def touched(bench: PlantBench) -> str:
    """What stopped an approach; what it was is in the latched text."""
    bench.begin(*TOUCH)
    bench.until(lambda: bench.mode in (Mode.SAFE, Mode.IDLE))
    return bench.loop.machine.latched.text if bench.loop.machine.latched else ""


@PRODUCTS
def test_a_sign_that_turned_since_the_calibration_is_found_before_2_N_and_named(product: Product) -> None:
    bench = PlantBench(product, linear(2.0))
    bench.force.gain = -1.0
    said = touched(bench)
    assert bench.latched == "first_touch"
    assert "compression is negative on fz: the sign is wrong" in said
    assert bench.true_peak_N < 2.0


@PRODUCTS
def test_another_channel_that_answers_is_found_before_2_N_and_named(product: Product) -> None:
    bench = PlantBench(product, linear(2.0))
    bench.force.channel = 0
    said = touched(bench)
    assert bench.latched == "first_touch"
    assert " N on fx (" in said and "another channel answers" in said
    assert bench.true_peak_N < 2.0


@pytest.mark.parametrize(("product", "bound_N"), [(BOTA, 2.5), (FT300, 9.0)], ids=["1 kHz", "100 Hz"])
def test_a_channel_that_is_dead_is_found_by_the_moment_that_comes_without_a_force(
    product: Product, bound_N: float
) -> None:
    bench = PlantBench(product, linear(2.0))
    bench.force.gain = 0.0
    said = touched(bench)
    assert bench.latched == "first_touch"
    assert "N m but only" in said and "along fz: that channel seems dead" in said
    assert bench.true_peak_N < bound_N


@PRODUCTS
@pytest.mark.parametrize(("gain", "channel"), [(-1.0, 2), (1.0, 0)])
def test_without_the_check_the_same_sensors_press_up_to_the_limit(product: Product, gain: float, channel: int) -> None:
    bench = PlantBench(product, linear(2.0), table=WITHOUT)
    bench.force.gain, bench.force.channel = gain, channel
    touched(bench)
    assert bench.latched == "force_limit"
    assert bench.true_peak_N > 14.0


@PRODUCTS
def test_a_sound_sensor_is_not_disturbed_in_one_program_nor_in_the_next(product: Product) -> None:
    bench = PlantBench(product, linear(2.0))
    assert [bench.run(*TRIAL)["cause"] for _ in range(2)] == ["", ""]
    assert 5.5 < bench.true_peak_N < 7.0


def test_a_sign_that_turns_between_two_programs_is_found_in_the_second() -> None:
    bench = PlantBench(BOTA, linear(2.0))
    assert bench.run(*TRIAL)["cause"] == ""
    bench.force.gain = -1.0
    touched(bench)
    assert bench.latched == "first_touch"


def state(fx_N: float, fz_N: float, my_N_m: float = 0.0, samples: int = 0) -> LoopState:
    """A touch as the sensor shows it, from a zero of nothing; compression is negative along fz."""
    return LoopState(
        wrench=(fx_N, 0.0, fz_N, 0.0, my_N_m, 0.0), zero=(0.0,) * 6, force_N=-fz_N, force_samples=samples,
        noise_N_m=0.0003,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("seen", "wrong"),
    [
        ((0.0, -0.99, 0.0), False),
        ((0.0, -1.01, 0.0), False),
        ((0.0, 1.01, 0.0), True),
        ((0.0, 0.99, 0.0), False),
        ((1.01, 0.0, 0.0), True),
        ((0.98, -1.0, 0.0), False),
        ((1.1, -1.0, 0.0), True),
        ((0.0, -0.03, 0.0021), True),
        ((0.0, -0.03, 0.0019), False),
        ((0.0, -0.05, 0.0021), False),
        ((0.0, 1.0, 0.0), True),
        ((10.0, -7.0, 0.0), True),
        ((0.0, 0.0, 0.002), True),
        ((0.0, -0.04, 0.002), False),
    ],
)
def test_from_one_newton_on_seven_tenths_are_along_and_a_moment_comes_with_a_force(
    seen: tuple[float, float, float], wrong: bool
) -> None:
    touch = FirstTouch(wired())
    said = [touch.update(state(*seen, samples=count)) for count in (1, 2, 2)]
    assert [bool(sentence) for sentence in said] == [False, wrong, False]


def test_one_disturbed_sample_is_no_touch_and_a_confirmed_one_is_not_asked_again() -> None:
    touch = FirstTouch(wired())
    spikes = [touch.update(state(5.0 * (count % 2), 0.0, samples=count)) for count in range(1, 9)]
    assert spikes == [""] * 8
    assert touch.update(state(0.0, -1.5, samples=10)) == ""
    assert [touch.update(state(3.0, 0.0, samples=count)) for count in (11, 12, 13)] == [""] * 3
    touch.begin()
    assert [bool(touch.update(state(3.0, 0.0, samples=count))) for count in (14, 15)] == [False, True]


@pytest.mark.parametrize(("moment_N_m", "wrong"), [(0.0031, True), (0.0029, False)])
def test_a_moment_counts_from_three_times_its_noise_on(moment_N_m: float, wrong: bool) -> None:
    touch, seen = FirstTouch(wired()), state(0.0, 0.0, moment_N_m)
    said = [touch.update(replace(seen, noise_N_m=0.001, force_samples=count)) for count in (1, 2)]
    assert [bool(sentence) for sentence in said] == [False, wrong]


@pytest.mark.parametrize("seen", [(0.0, -1.0), (51**0.5, -7.0)])
def test_one_newton_is_a_touch_and_seven_tenths_of_it_along_confirm_it(seen: tuple[float, float]) -> None:
    touch = FirstTouch(wired())
    said = [touch.update(state(*load, samples=count)) for count, load in enumerate([seen, (3.0, 0.0), (3.0, 0.0)], 1)]
    assert said == [""] * 3


def test_a_touch_after_one_disturbed_sample_is_a_touch() -> None:
    touch = FirstTouch(wired())
    assert touch.update(state(5.0, 0.0, samples=1)) == ""
    assert touch.update(state(0.0, -2.0, samples=2)) == ""


def wrong_after(zero: Wrench, wrench: Wrench) -> str:
    """What is said of ``wrench`` where the sensor gave ``zero`` in the air."""
    touch, along_N = FirstTouch(wired()), zero[2] - wrench[2]
    seen = LoopState(wrench=wrench, zero=zero, force_N=along_N)
    touch.update(replace(seen, force_samples=1))
    return touch.update(replace(seen, force_samples=2))


def test_what_a_channel_gives_is_told_from_its_zero() -> None:
    said = wrong_after((-4.0, 1.0, 2.0, 0.0, 0.0, 0.0), (-4.1, 3.5, 1.9, 0.0, 0.0, 0.0))
    assert said.startswith("the first touch gives +2.50 N on fy (0.10 of 2.50 N along), where")


@pytest.mark.parametrize(("fz_N", "why"), [(-0.65, "another channel answers"), (0.65, "the sign is wrong")])
def test_only_a_push_read_as_a_pull_is_a_wrong_sign(fz_N: float, why: str) -> None:
    sideways_N = 0.95 * abs(fz_N)
    assert why in wrong_after((0.0,) * 6, (sideways_N, -sideways_N, fz_N, 0.0, 0.0, 0.0))
