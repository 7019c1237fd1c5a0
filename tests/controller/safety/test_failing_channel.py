"""A force channel that fails while the tip presses, at the limits that hold where none are stated, and sound ones."""

import random
from collections.abc import Callable

import pytest

from controller.loop.modes import Mode
from controller.loop.setpoint import Setpoint
from controller.loop.steps import Compress, Hold, Retract, Step
from controller.safety.load import NO_WRENCH, LoadMonitor
from controller.safety.table import TABLE
from tests.controller.plant_bench import BOTA, FT300, PRODUCTS, TOUCH, PlantBench, Product, curve, linear, rammed
from tests.controller.safety.test_force_limit import BOUND_N, LIMIT_N, TRACKED, tracking

PRESSES_N = (0.1, 3.0, 1.0, 3.0, 1.0, 3.0, 1.0)
STILL = Setpoint(20.0, 0.0)
WITHOUT = tuple(line for line in TABLE if line.code != "contact_lost")


def dead(bench: PlantBench) -> None:
    bench.force.gain = 0.0


def halved(bench: PlantBench) -> None:
    bench.force.gain = 0.5


def turned(bench: PlantBench) -> None:
    bench.force.gain = -1.0


def crossed(bench: PlantBench) -> None:
    bench.force.channel = 0


FAULTS = pytest.mark.parametrize("fault", [dead, halved, turned, crossed])


def struck(
    bench: PlantBench, step: Step, when: Callable[[PlantBench], bool], fault: Callable[[PlantBench], None]
) -> None:
    """``fault`` as soon as ``when`` holds during ``step``, then up to the end."""
    bench.begin(*TOUCH, step)
    bench.until(lambda: bench.loop.machine.step_index == 2 and when(bench))
    fault(bench)
    bench.until(lambda: bench.mode in (Mode.SAFE, Mode.IDLE))


def rising(bench: PlantBench) -> bool:
    return bench.force.true_N > 2.0 and bench.loop.state.velocity_mm_s > 0.2


def falling(bench: PlantBench) -> bool:
    return bench.force.true_N > 1.5 and bench.loop.state.velocity_mm_s < -0.2


@PRODUCTS
@FAULTS
@pytest.mark.parametrize("when", [rising, falling])
def test_a_channel_that_fails_while_a_force_is_tracked_is_noticed_before_anything_is_felt(
    product: Product, when: Callable[[PlantBench], bool], fault: Callable[[PlantBench], None]
) -> None:
    bench = PlantBench(product, curve(TRACKED.force_N))
    struck(bench, tracking(product, PRESSES_N, 1.0), when, fault)
    assert bench.latched == "contact_lost"
    assert bench.true_peak_N < 3.5


@pytest.mark.parametrize(
    ("product", "at_N"), [(BOTA, 2.5), (BOTA, 6.0), (FT300, 6.0)], ids=["1 kHz early", "1 kHz", "100 Hz"]
)
@FAULTS
@pytest.mark.parametrize("stiffness_N_mm", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("speed_mm_s", [10.0, 30.0])
def test_a_channel_that_fails_in_a_press_is_noticed_before_the_limit(
    product: Product, fault: Callable[[PlantBench], None], stiffness_N_mm: float, speed_mm_s: float, at_N: float
) -> None:
    bench = PlantBench(product, linear(stiffness_N_mm))
    press = Compress(depth_mm=15.0, speed_mm_s=speed_mm_s, force_limit_N=LIMIT_N)
    struck(bench, press, lambda bench: bench.force.true_N > at_N, fault)
    swift = fault in (turned, crossed)  # so much of a change that its rate or the peak foreseen may be told first
    assert bench.latched == "contact_lost" or (swift and bench.latched in ("force_rate", "force_limit"))
    assert bench.true_peak_N < BOUND_N


@PRODUCTS
def test_without_the_check_a_dead_channel_presses_beyond_the_limit(product: Product) -> None:
    bench = PlantBench(product, curve(TRACKED.force_N), table=WITHOUT)
    struck(bench, tracking(product, PRESSES_N, 1.0), rising, dead)
    assert bench.true_peak_N > BOUND_N


@PRODUCTS
def test_a_channel_that_died_in_the_air_between_two_presses_is_noticed_below_the_surface(product: Product) -> None:
    bench = PlantBench(product, linear(2.0))
    bench.run(*TOUCH, Retract(clearance_mm=3.0, speed_mm_s=20.0))
    bench.begin(*TOUCH, Retract(clearance_mm=3.0, speed_mm_s=20.0), Hold(duration_s=0.2),
                Compress(depth_mm=12.0, speed_mm_s=10.0, force_limit_N=LIMIT_N))  # fmt: skip
    bench.until(lambda: bench.loop.machine.step_index == 3)
    bench.force.gain, bench.force.lever_m = 0.0, 0.0
    bench.until(lambda: bench.mode in (Mode.SAFE, Mode.IDLE))
    assert bench.latched == "contact_lost"
    assert bench.loop.machine.latched and "nothing is felt 3.0 mm beyond" in bench.loop.machine.latched.text
    assert 6.0 < bench.true_peak_N < 7.5


@PRODUCTS
@pytest.mark.parametrize("stiffness_N_mm", [0.2, 1.0, 5.0, 20.0])
def test_a_sound_sensor_in_presses_and_retractions_at_full_speed_is_not_disturbed(
    product: Product, stiffness_N_mm: float
) -> None:
    deep_mm = min(10.0 / stiffness_N_mm, 8.0)
    speed_mm_s = 30.0 if stiffness_N_mm <= 5.0 else 5.0
    bench = PlantBench(product, linear(stiffness_N_mm))
    bench.begin(
        *rammed(5.0)[:3],
        *2 * (
            Compress(depth_mm=deep_mm, speed_mm_s=speed_mm_s, force_limit_N=LIMIT_N),
            Hold(duration_s=0.1),
            Compress(depth_mm=0.2 * deep_mm, speed_mm_s=speed_mm_s, force_limit_N=LIMIT_N),
            Hold(duration_s=0.1),
            Retract(clearance_mm=3.0, speed_mm_s=30.0),
        ),
    )  # fmt: skip
    bench.until(lambda: bench.mode in (Mode.SAFE, Mode.IDLE))
    assert bench.latched == ""


@PRODUCTS
def test_a_force_that_is_asked_to_fall_at_once_is_not_lost(product: Product) -> None:
    bench = PlantBench(product, curve(TRACKED.force_N))
    jumps = tracking(product, (3.0, 3.0, 0.5, 0.5, 9.0, 9.0, 1.0, 1.0), 0.3)
    jumps = jumps.model_copy(update={"times_s": (0.0, 1.0, 1.001, 2.0, 2.001, 3.0, 3.001, 4.0)})
    bench.begin(*TOUCH, jumps)
    bench.until(lambda: bench.mode in (Mode.SAFE, Mode.IDLE))
    assert bench.latched == ""
    assert bench.true_peak_N > 8.5


@PRODUCTS
def test_noise_alone_takes_no_force_away(product: Product) -> None:
    hiss, period_ns = random.Random(7), round(1e9 / product.rate_Hz)
    monitor = LoadMonitor(period_ns)
    for number in range(100_000):
        monitor.axis(number * period_ns, 20.0)
        channels_N = (hiss.gauss(0.0, product.noise_N), 0.0, hiss.gauss(0.81, product.noise_N))
        monitor.force(number * period_ns, (*channels_N, 0.0, 0.0, 0.0))
        assert monitor.load(number * period_ns, NO_WRENCH, product.noise_N, STILL, 2000.0).vanished_N == 0.0
