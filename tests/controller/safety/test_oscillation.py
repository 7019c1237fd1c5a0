"""The force loop that swings by itself is stopped, on tissue stiffer than it tolerates and on nothing else."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.experiments import tracking
from controller.experiments.references import parse_reference
from controller.law.force_profile import Line
from controller.loop.modes import Mode
from controller.loop.state import LoopState
from controller.loop.steps import Approach, TrackForce
from controller.safety.oscillation import OscillationMonitor
from controller.safety.table import TABLE
from mock_devices.testing.made.subjects import RESPONSE, SLOW_RESPONSE
from mock_devices.testing.models import index_model
from tests.controller.fake_bench import ZERO
from tests.controller.plant_bench import BOTA, FT300, PRODUCTS, PlantBench, Product, curve

MODEL = index_model(0.12, 0.22, 0.01, force_N=11.0)
STIFF_MM = 4.0
# Tissue of the model has 0.55 N/mm there; this bench has no damping besides.
TOO_STIFF_N_MM = {BOTA: 20.0, FT300: 6.0}
SECONDS = np.arange(0.0, 6.0, 0.001)
Column = NDArray[np.float64]


def tissue_N(stiff_N_mm: float) -> Callable[[float], float]:
    """The model's own tissue with something of ``stiff_N_mm`` from 4 mm on."""
    return lambda depth_mm: 0.12 * depth_mm * math.exp(0.22 * depth_mm) + stiff_N_mm * max(depth_mm - STIFF_MM, 0.0)


def track(bench: PlantBench, reference: str = "press:2,base_N=1,frequency_Hz=1,duration_s=3") -> TrackForce:
    """The product's law for its model, following a reference."""
    response = RESPONSE if bench.wiring.force.sampled_Hz > 500 else SLOW_RESPONSE
    late_s = bench.force.latency_ns * 1e-9
    response = response._replace(delay_s=response.delay_s + late_s)
    law, given = tracking.force_law(MODEL, bench.wiring, response), parse_reference(reference)
    return law.model_copy(update={"times_s": given.times_s, "forces_N": given.forces_N, "repeats": given.repeats})


def pressed(product: Product, stiff_N_mm: float, without: str = "") -> PlantBench:
    """A bench that follows 1 to 3 N, until it stops or is done."""
    table = tuple(line for line in TABLE if line.code != without)
    bench = PlantBench(product, curve(tissue_N(stiff_N_mm)), table=table)
    bench.begin(ZERO, Approach(speed_mm_s=5.0, contact_force_N=0.3, search_to_mm=40.0), track(bench))
    bench.until(lambda: bench.mode in (Mode.IDLE, Mode.SAFE), within_s=30.0)
    return bench


@PRODUCTS
def test_tissue_stiffer_than_the_loop_tolerates_is_left_and_named(product: Product) -> None:
    bench = pressed(product, TOO_STIFF_N_MM[product])
    assert bench.latched == "oscillation"
    [incident] = bench.link.of("incident")
    assert "the force swings by itself, 6 turns by more than" in incident["text"]
    assert incident["action"] == "SOFT"
    assert bench.axis.position_mm < bench.loop.state.surface_mm - 9.0
    assert bench.loop.state.peak_force_N < 12.0


@PRODUCTS
def test_without_the_check_it_goes_on_swinging(product: Product) -> None:
    """The planted bug: of the whole table only the force limit may notice, where it grows so far."""
    assert pressed(product, TOO_STIFF_N_MM[product], without="oscillation").latched in ("", "force_limit")


@PRODUCTS
def test_tissue_that_the_loop_tolerates_is_pressed_on(product: Product) -> None:
    assert pressed(product, 1.0).latched == ""


def heard(force_N: Column, reference_N: Column, noise_N: float = 0.005) -> list[float]:
    """When a monitor that is given this speaks [s]."""
    monitor, state = OscillationMonitor(), LoopState(noise_N=noise_N)
    found = []
    for at_s, now_N, asked_N in zip(SECONDS, force_N, reference_N, strict=True):
        state.force_N, state.reference_N = float(now_N), float(asked_N)
        if monitor.update(state):
            found.append(float(at_s))
    return found


def swing(amplitude_N: float, frequency_Hz: float) -> Column:
    return np.asarray(amplitude_N * np.sin(2 * np.pi * frequency_Hz * SECONDS))


@pytest.mark.parametrize("frequency_Hz", [14.0, 20.0, 40.0, 80.0, 140.0])
def test_a_swing_in_the_band_is_heard_after_six_turns(frequency_Hz: float) -> None:
    two_N = np.full_like(SECONDS, 2.0)
    first_s = heard(two_N + swing(0.3, frequency_Hz), two_N)[0]
    assert 6.0 / frequency_Hz <= first_s <= 7.5 / frequency_Hz


@pytest.mark.parametrize(
    ("amplitude_N", "frequency_Hz"),
    [(0.15, 40.0), (2.0, 0.25), (1.0, 1.2), (1.0, 2.0), (0.8, 3.0), (0.5, 8.0), (0.5, 11.0)],
    ids=["small", "breathing", "pulse", "limb", "limb, fast", "tremor", "tremor, fast"],
)
def test_what_is_small_or_slow_is_not(amplitude_N: float, frequency_Hz: float) -> None:
    two_N = np.full_like(SECONDS, 2.0)
    assert heard(two_N + swing(amplitude_N, frequency_Hz), two_N) == []


def test_what_is_quicker_than_any_loop_swings_is_not() -> None:
    """Half waves of 2 ms, as 250 Hz has: a grid that hears each sample twice would show such."""
    two_N = np.full_like(SECONDS, 2.0)
    quick_N = 0.5 * np.where(np.arange(len(SECONDS)) % 4 < 2, 1.0, -1.0)
    assert heard(two_N + quick_N, two_N) == []


def sides(count: int) -> Column:
    """An error of 1 N that changes its sign every 10 ms, ``count`` times in all, and is none after that."""
    return np.concatenate([np.full(10, (-1.0) ** side) for side in range(count)])


def spoke(error_N: Column, before_N: float = math.nan) -> bool:
    """Whether a monitor says so of this error, of which there is none before."""
    monitor, state = OscillationMonitor(), LoopState(reference_N=0.0)
    state.force_N = before_N
    monitor.update(state)
    said = []
    for now_N in error_N:
        state.force_N = float(now_N)
        said.append(monitor.update(state))
    return any(said)


@pytest.mark.parametrize(("count", "heard_then"), [(13, False), (14, True)])
def test_twelve_half_waves_are_six_turns(count: int, heard_then: bool) -> None:
    """The first side is that of the error itself, of whose mean nothing is known; the second is the first beyond it."""
    assert spoke(sides(count)) is heard_then


@pytest.mark.parametrize(("count", "heard_then"), [(12, False), (13, True)])
def test_what_swung_before_a_rest_does_not_count(count: int, heard_then: bool) -> None:
    """Nor does the rest itself, which is no half wave of the band."""
    assert spoke(np.concatenate([sides(8), np.zeros(60), sides(count)])) is heard_then


def test_what_swung_before_the_force_was_unknown_does_not_count() -> None:
    assert not spoke(np.concatenate([sides(8), [math.nan], sides(10)]))
    assert spoke(np.concatenate([sides(8), sides(10)]))


def test_a_swing_about_a_standing_error_is_heard() -> None:
    two_N = np.full_like(SECONDS, 2.0)
    assert 0.15 < heard(two_N + 1.0 + swing(0.3, 40.0), two_N)[0] < 0.3


def test_how_the_reference_moved_is_forgotten_in_half_a_second() -> None:
    asked_N = np.where(SECONDS < 1.0, 2.0, 3.0)
    late_N = np.where(SECONDS < 1.5, 0.0, swing(0.4, 40.0))
    assert 1.65 < heard(asked_N + late_N, asked_N)[0] < 2.0


def test_a_noisy_sensor_is_none() -> None:
    noise_N = 0.05 * np.repeat(np.random.default_rng(3).standard_normal(len(SECONDS) // 10), 10)
    two_N = np.full_like(SECONDS, 2.0)
    assert heard(two_N + noise_N, two_N, noise_N=0.05) == []


@pytest.mark.parametrize("frequency_Hz", [5.0, 10.0, 16.0])
@pytest.mark.parametrize("gain", [0.0, 0.5, 1.8], ids=["does not follow", "half", "over"])
def test_a_reference_that_is_followed_badly_is_none(frequency_Hz: float, gain: float) -> None:
    """Up to half of the axis' bandwidth, 17 Hz, which is the fastest that may be asked for."""
    assert heard(2.0 + gain * swing(0.5, frequency_Hz), 2.0 + swing(0.5, frequency_Hz)) == []


def test_jumps_that_ring_are_none() -> None:
    """Each jump of 1 N rings by half of it at 25 Hz, a third less each turn."""
    asked_N = 2.0 + np.floor(SECONDS)
    since_s = SECONDS % 1.0
    ringing_N = 0.5 * np.exp(-since_s * 25.0 * math.log(1.5)) * np.cos(2 * np.pi * 25.0 * since_s)
    assert heard(asked_N + ringing_N, asked_N) == []


def test_the_same_jumps_that_do_not_cease_are_heard() -> None:
    asked_N = 2.0 + np.floor(SECONDS)
    assert heard(asked_N + swing(0.5, 25.0), asked_N) != []


@pytest.mark.extra
@PRODUCTS
@pytest.mark.parametrize("reference", ["vibrate:0.5", "knead:2", "sine:0.5,mean_N=2,frequency_Hz=10"])
@pytest.mark.parametrize("stiffness", [0.5, 1.0, 2.0])
def test_the_studys_references_are_followed_on_tissue_half_to_twice_as_stiff(
    product: Product, reference: str, stiffness: float
) -> None:
    """By the simulation's own run of the law, heard by the monitor: hundreds of turns without a word."""
    from benchmarks.control.cases import DT_S  # noqa: PLC0415 - loads numba
    from benchmarks.control.laws import shaped  # noqa: PLC0415
    from benchmarks.control.motion import run  # noqa: PLC0415
    from benchmarks.control.plants import FAST, SLOW, Plant, limb_of, model_of  # noqa: PLC0415

    slow = product is FT300
    plant = Plant(sensing=SLOW if slow else FAST)
    law, given = shaped("average", plant), parse_reference(reference)
    line = Line((0.0, 1.0, *(1.0 + at_s for at_s in given.times_s)), (0.1, given.forces_N[0], *given.forces_N))
    once_s = given.times_s[-1]
    asked_N = np.where(
        SECONDS < 1.0, np.interp(SECONDS, line.times_s, line.forces_N),
        np.interp((SECONDS - 1.0) % once_s, given.times_s, given.forces_N),
    )  # fmt: skip
    found = run(law, asked_N, plant.bench(limb_of(model_of("average"), stiffness), np.zeros(len(SECONDS) + 1)), 1, DT_S)
    assert heard(found.sensed_N, asked_N, noise_N=plant.sensing.noise_N) == []


@pytest.mark.parametrize(("noise_N", "amplitude_N"), [(0.01, 0.2), (0.1, 0.6)])
def test_a_half_wave_passes_six_standard_deviations_and_a_fifth_of_a_newton(noise_N: float, amplitude_N: float) -> None:
    assert OscillationMonitor().amplitude_N(LoopState(noise_N=noise_N)) == pytest.approx(amplitude_N)


def test_nothing_is_heard_where_no_force_is_asked_for() -> None:
    silent = np.full_like(SECONDS, math.nan)
    assert heard(2.0 + swing(1.0, 40.0), silent) == []
