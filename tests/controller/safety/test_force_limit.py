"""The force limit against an axis that lags and sensors that filter, delay and hiss: what the tissue really bears."""

import math
from typing import Any

import pytest

from controller.law import synthesis
from controller.law.gain_table import gain_rows, span_of
from controller.law.loop_response import Rates
from controller.loop.modes import Mode
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.steps import Approach, Hold, Step, TrackForce
from controller.safety.inputs import SafetyInputs
from controller.safety.load import NO_WRENCH, LoadMonitor
from controller.safety.table import TABLE, evaluate
from mock_devices.testing.models import index_model
from mock_devices.testing.spring_bench import WIRING
from rig.config.axis_response import AxisResponse
from rig.simulation.axis_plant import ModelledLimb
from tests.controller.fake_bench import ZERO, wired
from tests.controller.plant_bench import BOTA, FT300, PRODUCTS, PlantBench, Product, curve, exponential, linear, rammed

LIMIT_N, BOUND_N = 15.0, 16.5


def stopped(bench: PlantBench, *steps: Step) -> PlantBench:
    """The bench after a program that ends in a stop."""
    bench.begin(*steps)
    bench.until(lambda: bench.mode is Mode.SAFE)
    return bench


@PRODUCTS
@pytest.mark.parametrize("phase_mm", [0.0, 0.16])
@pytest.mark.parametrize(
    "limb", [linear(1.0), linear(2.0), linear(5.0), exponential(5.0, LIMIT_N)], ids=["1", "2", "5", "to 5"]
)
def test_at_30_mm_s_on_tissue_up_to_5_N_mm_the_peak_stays_below_a_tenth_over_the_limit(
    product: Product, limb: ModelledLimb, phase_mm: float
) -> None:
    bench = stopped(PlantBench(product, limb._replace(surface_mm=20.0 + phase_mm)), *rammed(30.0))
    assert bench.latched == "force_limit"
    assert 0.8 * LIMIT_N < bench.true_peak_N < BOUND_N


@pytest.mark.parametrize(
    ("product", "stiffness_N_mm", "bound_N"),
    [(BOTA, 10.0, 15.0), (BOTA, 20.0, 15.0), (BOTA, 50.0, 24.0), (FT300, 10.0, 15.0), (FT300, 20.0, 23.0),
     (FT300, 50.0, 52.0)],
)  # fmt: skip
def test_on_harder_things_the_peak_at_30_mm_s_is_what_the_documentation_states(
    product: Product, stiffness_N_mm: float, bound_N: float
) -> None:
    bench = stopped(PlantBench(product, linear(stiffness_N_mm)), *rammed(30.0))
    assert (bench.latched, bench.true_peak_N < bound_N) == ("force_limit", True), bench.true_peak_N


@PRODUCTS
@pytest.mark.parametrize("stiffness_N_mm", [20.0, 50.0])
def test_even_something_hard_is_met_softly_at_the_speed_of_an_approach(product: Product, stiffness_N_mm: float) -> None:
    blind = wired(product.rate_Hz, tracker=None, force={"axis": "fx"})
    steps = (ZERO, Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0))
    bench = stopped(PlantBench(product, linear(stiffness_N_mm), blind), *steps)
    assert bench.true_peak_N < BOUND_N


@PRODUCTS
@pytest.mark.parametrize("force", [{"compression": "positive"}, {"axis": "fx"}, {"axis": "fy"}])
@pytest.mark.parametrize("speed_mm_s", [5.0, 30.0])
def test_a_wrong_word_for_channel_or_sign_does_not_press_harder(
    product: Product, force: dict[str, Any], speed_mm_s: float
) -> None:
    steps = (ZERO, Approach(speed_mm_s=speed_mm_s, contact_force_N=0.05, search_to_mm=60.0))
    bench = stopped(PlantBench(product, linear(5.0), wired(product.rate_Hz, tracker=None, force=force)), *steps)
    assert bench.true_peak_N < BOUND_N


def test_without_the_check_a_wrong_channel_presses_as_deep_as_the_search_goes() -> None:
    without = tuple(line for line in TABLE if line.code not in ("force_limit", "first_touch"))
    bench = PlantBench(BOTA, linear(2.0), wired(tracker=None, force={"axis": "fx"}), table=without)
    stopped(bench, ZERO, Approach(speed_mm_s=10.0, contact_force_N=0.05, search_to_mm=34.0))
    assert bench.true_peak_N == pytest.approx(28.0, abs=1.0)


RAMPS_N = (0.1, 13.5, 13.5, 0.5, 13.5, 13.5)
SINE_N = (0.1, *(7.0 + 6.5 * math.sin(0.2 * math.pi * at) for at in range(40)))
TRACKED = index_model(a_N_mm=0.5, b_per_mm=0.1, damping_N_s_mm=0.001, force_N=15.0)


def tracking(product: Product, forces_N: tuple[float, ...], every_s: float) -> TrackForce:
    """Follows ``forces_N`` one after the other with the law that the product's rate allows."""
    axis, rates = AxisResponse(0.002 + 0.5 / product.rate_Hz, 0.003, 0.003, 0.0065), Rates(0.001, 1 / product.rate_Hz)
    rows = gain_rows(TRACKED, [TRACKED.valid.depth_mm * share / 20 for share in range(21)])
    return TrackForce(
        times_s=tuple(every_s * at for at in range(len(forces_N))), forces_N=forces_N,
        gains=rows, delay_s=axis.delay_s, lag1_s=axis.lag1_s, lag2_s=axis.lag2_s, preview_s=axis.tip_lag_s,
        **synthesis.constants(axis, rates, span_of(TRACKED, rows, rates))._asdict(),
    )  # fmt: skip


@PRODUCTS
@pytest.mark.parametrize("track", [(RAMPS_N, 1.0), (SINE_N, 0.1)], ids=["ramps", "sine of 1 Hz"])
def test_tracking_up_to_nine_tenths_of_the_limit_is_not_disturbed(
    product: Product, track: tuple[tuple[float, ...], float]
) -> None:
    bench = PlantBench(product, curve(TRACKED.force_N))
    step = tracking(product, *track)
    bench.begin(ZERO, Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0), step, Hold(duration_s=0.5))
    bench.until(lambda: not bench.loop.machine.busy)
    assert bench.latched == ""
    assert 12.5 < bench.true_peak_N < LIMIT_N


@PRODUCTS
def test_pressing_at_full_speed_to_four_fifths_of_the_limit_is_not_disturbed(product: Product) -> None:
    bench = PlantBench(product, linear(1.5))
    bench.begin(*rammed(30.0)[:3], rammed(30.0)[3].model_copy(update={"depth_mm": 8.0}), Hold(duration_s=0.2))
    bench.until(lambda: not bench.loop.machine.busy)
    assert bench.latched == ""
    assert 11.8 < bench.true_peak_N < 13.0


@PRODUCTS
def test_a_limb_that_pushes_while_the_tip_rests_is_felt_before_the_limit(product: Product) -> None:
    bench = PlantBench(product, linear(2.0))
    bench.begin(ZERO, Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0), Hold(duration_s=5.0))
    bench.until(lambda: bench.loop.machine.step_index == 2)
    bench.wait(0.1)
    began_ns = bench.clock.now_ns
    bench.force.extra_N = lambda at_ns: 200.0 * max(at_ns - began_ns, 0) * 1e-9
    taken_s = bench.until(lambda: bench.mode is not Mode.COMPRESS)
    assert bench.latched == "force_limit"
    assert 200.0 * taken_s < LIMIT_N + 200.0 / product.rate_Hz, "at most what one sample brings"


@pytest.mark.parametrize(("period_ms", "samples"), [(1, 12), (10, 4), (40, 4)])
def test_the_rate_of_force_is_measured_at_every_rate_of_the_sensor(period_ms: int, samples: int) -> None:
    monitor = LoadMonitor(period_ms * 1_000_000)
    monitor.axis(0, 0.0)
    for number in range(samples):
        at_ns = number * period_ms * 1_000_000
        monitor.force(at_ns, (0.3 * at_ns * 1e-9 * 100, 0.0, -0.4 * at_ns * 1e-9 * 100, 0.0, 0.0, 0.0))
    load = monitor.load(at_ns, NO_WRENCH, 0.0, Setpoint(0.0, 0.0), 2000.0)
    assert load.rate_N_s == pytest.approx(50.0)
    assert load.predicted_N == pytest.approx(load.force_N)


@PRODUCTS
def test_a_rate_above_its_limit_stops_with_either_sensor(product: Product) -> None:
    wiring = wired(product.rate_Hz, tracker=None, limits={"force_rate_N_s": 20.0})
    bench = stopped(PlantBench(product, linear(1.0), wiring), *rammed(30.0))
    assert bench.latched == "force_rate"
    assert bench.true_peak_N < 3.0


def loaded(position_mm: float, ahead_mm: float, noise_N: float = 0.0, velocity_mm_s: float = 0.0) -> float:
    """Peak foreseen at 3 N/mm, seen by ten samples, the set-point so far ahead."""
    monitor = LoadMonitor(1_000_000)
    for number in range(10):
        place_mm = position_mm - 0.1 * (9 - number)
        monitor.axis(number * 1_000_000 - 500_000, place_mm)
    for number in range(10):
        place_mm = position_mm - 0.1 * (9 - number)
        monitor.force(number * 1_000_000, (0.0, 3.0 * place_mm, 0.0, 0.0, 0.0, 0.0))
    setpoint = Setpoint(position_mm + ahead_mm, velocity_mm_s)
    return monitor.load(9_000_000, NO_WRENCH, noise_N, setpoint, 2000.0).predicted_N


def test_the_peak_foreseen_is_load_and_stiffness_times_the_way_still_to_go() -> None:
    assert loaded(2.0, 0.0) == pytest.approx(6.0)
    assert loaded(2.0, 1.0) == pytest.approx(6.0 + 3.0 * 1.0 * (1 + 0.25 * 0.5 * 1.5))
    stopping_mm = 40.0**2 / 4000.0
    assert loaded(2.0, 0.0, velocity_mm_s=40.0) == pytest.approx(
        6.0 + 3.0 * stopping_mm * (1 + 0.125 * (stopping_mm + 0.5))
    )


def test_a_tip_that_leaves_is_not_foreseen_to_press() -> None:
    assert loaded(2.0, -1.0) == pytest.approx(6.0)
    assert loaded(2.0, 0.1, velocity_mm_s=-40.0) == pytest.approx(6.0)


def test_noise_makes_no_stiffness_and_a_restless_zero_does_not_blind_the_prediction() -> None:
    assert loaded(2.0, 1.0, noise_N=0.05) < loaded(2.0, 1.0)
    assert loaded(2.0, 1.0, noise_N=5.0) == loaded(2.0, 1.0, noise_N=0.15) > 8.0


def test_before_the_first_sample_nothing_is_known_and_an_unknown_load_is_a_stop() -> None:
    monitor = LoadMonitor(1_000_000)
    assert math.isnan(monitor.load(0, NO_WRENCH, 0.0, Setpoint(0.0, 0.0), 2000.0).predicted_N)
    incident = evaluate(LoopState(wrench=NO_WRENCH, position_mm=20.0), SafetyInputs(mode=Mode.APPROACH), WIRING)
    assert incident and incident.code == "force_limit"


def test_a_tip_that_is_levered_stops_by_its_torque() -> None:
    bench = PlantBench(BOTA, linear(1.0))
    bench.begin(ZERO, Hold(duration_s=9.0))
    bench.until(lambda: bench.loop.machine.step_index == 1)
    bench.force.moment_N_m = (0.31, 0.0, 0.4)
    bench.until(lambda: bench.mode is Mode.SAFE)
    assert bench.latched == "torque_limit"
    cause = bench.loop.machine.latched
    assert cause and "0.50" in cause.text and "limits.torque_N_m, 0.5 N m" in cause.text


@pytest.mark.parametrize(
    ("sideways_N", "moment_N_m", "named"),
    [((0.6, 0.0, 0.0), (0.0, 0.0, 0.0), "fx in the air moved by +0."),
     ((0.0, 0.0, 0.0), (0.0, 0.0, -0.08), "mz in the air moved by -0.0")],
)  # fmt: skip
def test_a_zero_that_drifted_in_any_channel_is_refused(
    sideways_N: tuple[float, float, float], moment_N_m: tuple[float, float, float], named: str
) -> None:
    bench = PlantBench(BOTA, linear(1.0))
    bench.run(ZERO)
    bench.force.sideways_N, bench.force.moment_N_m = sideways_N, moment_N_m
    bench.begin(ZERO)
    bench.until(lambda: bench.mode is Mode.SAFE)
    assert bench.loop.machine.latched and named in bench.loop.machine.latched.text


def test_before_the_first_zero_load_counts_from_the_calibrations_zero() -> None:
    bench = PlantBench(BOTA, linear(1.0))
    known = bench.wiring.calibration.of_force
    assert known
    bench.force.sideways_N = (known.zero_N[0], known.zero_N[1], known.zero_N[2] + bench.force.zero_N)
    bench.wait(0.1)
    assert bench.loop.state.load.force_N < 0.03
    bench.force.sideways_N = (known.zero_N[0] + 3.0, known.zero_N[1] + 4.0, known.zero_N[2] + bench.force.zero_N)
    bench.wait(0.1)
    assert bench.loop.state.load.force_N == pytest.approx(5.0, abs=0.03)


@PRODUCTS
def test_the_peak_that_is_told_holds_what_came_after_the_stop(product: Product) -> None:
    bench = stopped(PlantBench(product, linear(5.0)), *rammed(30.0))
    at_the_stop_N = bench.link.of("finished")[-1]["peak_force_N"]
    bench.wait(0.1)
    told_N = bench.link.statuses[-1]["peak_force_N"]
    assert told_N is not None and at_the_stop_N < told_N - 1.0
    assert told_N == pytest.approx(bench.true_peak_N, abs=0.3 if product is BOTA else 1.2)
