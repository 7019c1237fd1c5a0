"""A limb that pushes while the tip rests: the axis retreats from it, or lets go; wherever it stood and why."""

import pytest

from controller.loop.modes import Mode
from controller.loop.state import LoopState
from controller.loop.steps import Approach, Compress, Hold, Step
from controller.safety.giving_way import give_way
from controller.safety.inputs import SafetyInputs
from controller.safety.load import NO_WRENCH, TipLoad
from controller.safety.table import TABLE, Check, evaluate
from mock_devices.testing.clock import Clock
from rig.config.wiring import Limits, Wiring
from rig.errors import DeviceError
from tests.controller.fake_bench import ZERO, FakeBench, wired
from tests.controller.fake_devices import FakeAxis
from tests.controller.plant_bench import BOTA, PRODUCTS, PlantBench, Product, linear

INTO_CONTACT = (
    ZERO,
    Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0),
    Compress(depth_mm=2.0, speed_mm_s=10.0, force_limit_N=12.0),
)
BACK_DRIVEN = {"holds_unpowered": False}


def in_contact(
    product: Product = BOTA, *more: Step, wiring: Wiring | None = None, table: tuple[Check, ...] = TABLE
) -> PlantBench:
    """The tip 2 mm deep in 2 N/mm, at rest after its program or in the steps that come after."""
    bench = PlantBench(product, linear(2.0), wiring, table=table)
    bench.begin(*INTO_CONTACT, *more)
    bench.until(lambda: bench.loop.machine.step_index == 3 or not bench.loop.machine.busy)
    bench.wait(0.2)
    bench.true_peak_N = 0.0
    return bench


def push(bench: PlantBench, by_mm: float, speed_mm_s: float = 15.0) -> None:
    """The limb comes nearer by that much, then stays."""
    axis = bench.axis
    limb = axis.limb
    for cycle in range(round(by_mm / speed_mm_s * 1000)):
        axis.limb = limb._replace(surface_mm=limb.surface_mm - speed_mm_s * 1e-3 * (cycle + 1))
        bench.cycle()
    bench.wait(2.0)


def incidents(bench: PlantBench) -> list[str]:
    """Codes of what stopped motion, in order."""
    return [stop["code"] for stop in bench.link.of("incident")]


@PRODUCTS
def test_in_idle_a_limb_that_pushes_is_retreated_from(product: Product) -> None:
    bench = in_contact(product)
    assert (bench.mode, bench.latched) == (Mode.IDLE, "")
    push(bench, 6.0)
    assert (bench.mode, bench.latched) == (Mode.SAFE, "pushed")
    assert bench.true_peak_N < 16.5
    assert bench.force.true_N == 0.0


@PRODUCTS
def test_in_safe_after_an_emergency_stop_the_drive_is_enabled_again_only_to_retreat(product: Product) -> None:
    bench = in_contact(product, Hold(duration_s=60.0))
    bench.say("estop")
    bench.wait(0.1)
    assert (bench.mode, bench.latched, bench.axis.on) == (Mode.SAFE, "emergency_stop", False)
    bench.wait(1.0)
    assert not bench.axis.on, "nobody pushes: it stays where it was stopped"
    stopped_mm, seen = bench.axis.position_mm, len(bench.axis.commands)
    push(bench, 6.0)
    assert (bench.mode, incidents(bench)) == (Mode.SAFE, ["emergency_stop", "pushed"])
    assert bench.true_peak_N < 16.5
    assert bench.force.true_N == 0.0
    assert max(mm for _, mm in bench.axis.commands[seen:]) < stopped_mm + 0.02, "only away from the limb"


@PRODUCTS
def test_in_safe_after_a_soft_stop_a_limb_that_follows_is_retreated_from_again(product: Product) -> None:
    bench = in_contact(product, Hold(duration_s=60.0))
    bench.say("stop")
    bench.until(lambda: bench.mode is Mode.SAFE)
    push(bench, 14.0)
    assert incidents(bench) == ["operator_stop", "pushed"]
    assert bench.mode is Mode.SAFE
    assert bench.true_peak_N < 16.5
    assert bench.force.true_N == 0.0


@PRODUCTS
def test_while_a_step_holds_a_limb_that_pushes_is_retreated_from_by_the_force_limit(product: Product) -> None:
    bench = in_contact(product, Hold(duration_s=60.0))
    push(bench, 12.0)
    assert incidents(bench) == ["force_limit"]
    assert bench.true_peak_N < 16.5


@pytest.mark.parametrize(("code", "off"), [("pushed", ("pushed",)), ("force_limit", ("pushed", "force_limit"))])
def test_at_rest_each_of_the_two_force_checks_is_needed(code: str, off: tuple[str, ...]) -> None:
    without = tuple(line for line in TABLE if line.code not in off)
    bench = in_contact(table=without)
    push(bench, 6.0, speed_mm_s=60.0)
    assert code not in incidents(bench)
    assert (bench.force.true_N > 15.0) is (code == "force_limit")


@pytest.mark.parametrize(
    ("moment_N_m", "extra_N_s", "code"),
    [((0.6, 0.0, 0.0), 0.0, "torque_limit"), ((0.0, 0.0, 0.0), 2000.0, "force_rate")],
)
def test_torque_and_rate_are_looked_at_too_while_the_tip_rests(
    moment_N_m: tuple[float, float, float], extra_N_s: float, code: str
) -> None:
    bench = in_contact(wiring=wired(tracker=None, limits={"pushed_N": 15.0, "force_rate_N_s": 200.0}))
    began_ns = bench.clock.now_ns
    bench.force.moment_N_m = moment_N_m
    bench.force.extra_N = lambda at_ns: min(extra_N_s * max(at_ns - began_ns, 0) * 1e-9, 3.0)
    bench.wait(0.1)
    assert incidents(bench)[0] == code


def test_an_axis_that_can_be_pushed_is_released_once_and_stays_so_until_it_is_acknowledged() -> None:
    bench = in_contact(wiring=wired(tracker=None, limits={"when_pushed": "release"}, axis=BACK_DRIVEN))
    seen = len(bench.axis.commands)
    push(bench, 3.5)
    assert (bench.mode, incidents(bench)) == (Mode.SAFE, ["pushed"])
    assert (bench.axis.limp, bench.axis.calls.count("power_off")) == (True, 1)
    assert len(bench.axis.commands) - seen < 400, "once released it is not commanded any more"
    bench.say("reset")
    bench.wait(0.1)
    assert (bench.axis.limp, bench.mode) == (False, Mode.IDLE)


def test_releasing_an_axis_that_holds_without_power_is_refused_with_the_reason() -> None:
    with pytest.raises(ValueError, match=r"limits.when_pushed release: axis.holds_unpowered .* use retreat"):
        wired(limits={"when_pushed": "release"})


def test_a_drive_in_fault_cannot_give_way_and_says_so_once() -> None:
    bench = in_contact()
    bench.axis.fault_text = "0x2310 overcurrent"
    push(bench, 6.0)
    said = [event.text for event in bench.ring.events if event.code == "no_way"]
    assert said == ["the axis cannot give way, its drive is in fault (0x2310 overcurrent): take the limb away"]
    assert bench.mode is Mode.SAFE


def test_at_the_end_of_its_way_it_has_given_way_and_does_not_repeat_itself() -> None:
    bench = in_contact(wiring=wired(tracker=None, limits={"position_min_mm": 14.0}))
    push(bench, 12.0)
    assert incidents(bench) == ["pushed"]
    assert bench.axis.position_mm == pytest.approx(14.0, abs=0.05)


def test_what_a_lost_sensor_said_last_is_not_given_way_to() -> None:
    bench = in_contact()
    bench.force.extra_N = lambda _: 0.0
    bench.force.silent = True
    bench.wait(0.5)
    bench.loop.state.load = bench.loop.state.load._replace(force_N=30.0)
    bench.cycle()
    assert (bench.mode, bench.latched) == (Mode.IDLE, "")


def test_a_drift_that_is_accepted_at_rest_moves_nothing() -> None:
    bench = in_contact()
    began_ns = bench.clock.now_ns
    bench.force.extra_N = lambda at_ns: 2.0 * max(at_ns - began_ns, 0) * 1e-9
    bench.wait(2.0)
    assert (bench.mode, bench.latched) == (Mode.IDLE, "")
    bench.wait(1.0)
    assert incidents(bench) == ["pushed"]


def test_the_drive_is_enabled_only_where_it_is_not() -> None:
    axis = FakeAxis(Clock(), 1)
    assert give_way(axis, Limits())
    assert "enable" not in axis.calls
    axis.on = False
    assert give_way(axis, Limits())
    assert axis.on
    axis.fault_text = "0x8611 following error"
    with pytest.raises(DeviceError, match="cannot give way, its drive is in fault"):
        give_way(axis, Limits())


@pytest.mark.parametrize("mode", [Mode.IDLE, Mode.SAFE])
def test_a_sensor_without_zero_or_calibration_may_show_anything_at_rest_but_a_push_is_felt(mode: Mode) -> None:
    shown = TipLoad(force_N=25.0, torque_N_m=2.0, rate_N_s=0.0, stiffness_N_mm=0.0, predicted_N=25.0, vanished_N=0.0)
    state = LoopState(load=shown, rest_N=25.0)
    assert evaluate(state, SafetyInputs(mode=mode), Wiring(), at_rest=True) is None
    state.rest_N = 19.9
    assert (felt := evaluate(state, SafetyInputs(mode=mode), Wiring(), at_rest=True)) and felt.code == "pushed"
    state.reference_zero, state.rest_N = NO_WRENCH, 25.0
    assert (felt := evaluate(state, SafetyInputs(mode=mode), Wiring(), at_rest=True)) and felt.code == "force_limit"


def test_with_a_calibration_the_limits_hold_before_the_first_zero_too() -> None:
    bench = FakeBench(wired(tracker=None, limits={"pushed_N": 15.0}))
    bench.force.sideways_N = (15.5, 0.0, 0.0)
    bench.until(lambda: bench.mode is Mode.SAFE)
    assert bench.latched == "force_limit"
