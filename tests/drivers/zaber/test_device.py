"""The Zaber session with the simulated axis on its physics, on a clock in the test's hand and a line with a speed."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from drivers.epos4.cia402 import PdsState, decode_state
from drivers.zaber.device import ZaberAxis
from drivers.zaber.following import run_on_mm
from mock_devices.testing.zaber import MS, ZaberBench, homed
from rig.channels import AxisSample
from rig.config.products.zaber_ascii import ZaberWiring
from rig.config.wiring import Limits
from rig.errors import DeviceError, SafetyStop

SetPoint = Callable[[float], float]
START_MM = 10.0


def following(bench: ZaberBench, **settings: object) -> ZaberAxis:
    """Homed, at 10 mm, following set-points on a line of 115200 baud."""
    axis = homed(bench, **settings)
    axis.move_to(START_MM, 30.0)
    axis.enable()
    bench.baud = 115_200
    return axis


def led(bench: ZaberBench, axis: ZaberAxis, setpoint_mm: SetPoint, seconds: float) -> list[AxisSample]:
    """Commands as the loop does, each millisecond; what was reported."""
    start_ns, samples = bench.clock.now_ns, list[AxisSample]()
    for tick in range(round(seconds * 1000)):
        bench.run_until(start_ns + (tick + 1) * MS)
        samples += axis.poll(bench.clock.now_ns)
        axis.command(setpoint_mm(tick * 1e-3), bench.clock.now_ns)
    return samples


def following_well(axis: ZaberAxis) -> bool:
    return axis.enabled and not axis.fault


def idle(bench: ZaberBench, axis: ZaberAxis, seconds: float) -> list[AxisSample]:
    """Asks as the loop does while nothing is commanded."""
    start_ns, samples = bench.clock.now_ns, list[AxisSample]()
    for tick in range(round(seconds * 1000)):
        bench.run_until(start_ns + (tick + 1) * MS)
        samples += axis.poll(bench.clock.now_ns)
        axis.request(bench.clock.now_ns)
    return samples


def test_it_says_who_it_is_and_keeps_the_limits_by_itself() -> None:
    bench = ZaberBench()
    axis = bench.axis(Limits(position_min_mm=1.0, position_max_mm=40.0, speed_mm_s=50.0))
    axis.start()
    assert (axis.identity.product, axis.identity.serial, axis.identity.firmware) == ("zaber-ascii", "68123", "7.40")
    values = bench.mock.settings.values
    assert (values["limit.min"], values["limit.max"], values["comm.checksum"]) == (2000, 80_000, 1)
    assert values["maxspeed"] == 163_840  # 50 mm/s x 2000 x 1.6384
    assert values["limit.approach.maxspeed"] == 65_536  # 20 mm/s
    assert values["accel"] == 655  # 2000 mm/s2 x 2000 x 1.6384 / 10,000


def test_settings_that_are_right_are_not_written_again() -> None:
    bench = ZaberBench()
    bench.axis().start()
    before = len(bench.commands)
    bench.axis().start()
    assert not [line for line in bench.commands[before:] if b" set " in line]


def test_homing_ends_at_the_switch_with_a_reference() -> None:
    bench = ZaberBench()
    axis = bench.axis()
    axis.start()
    before = axis.referenced
    axis.home()
    assert (before, axis.referenced) == (False, True)
    assert bench.bench.axis.position_mm == pytest.approx(0.0, abs=0.05)


def test_a_move_arrives_and_no_order_of_it_reaches_further_than_a_leg() -> None:
    bench = ZaberBench()
    axis = homed(bench)
    before = len(bench.commands)
    axis.move_to(40.0, 20.0)
    assert bench.bench.axis.position_mm == pytest.approx(40.0, abs=0.05)
    targets = [int(line.split()[5]) / 2000 for line in bench.commands[before:] if b"move abs" in line]
    assert max(np.diff([0.0, *targets])) <= 20.0 * 0.25 + 0.01 and targets[-1] == pytest.approx(40.0, abs=0.03)


@pytest.mark.parametrize("waiting", ["home", "move", "history"])
def test_what_was_asked_before_a_wait_is_not_missed_behind_it(waiting: str) -> None:
    """What waits takes all replies: a position that was asked for just before it has come, and is no silence."""
    bench = ZaberBench()
    axis = homed(bench)
    axis.request(bench.clock.now_ns)
    {"home": axis.home, "move": lambda: axis.move_to(30.0, 20.0), "history": axis.history}[waiting]()
    bench.sleep(1.0)
    assert len(idle(bench, axis, 0.1)) > 5


@pytest.mark.parametrize(
    ("frequency_Hz", "amplitude_mm", "gain", "within"),
    [
        (0.5, 2.0, 1.0, 0.01),
        (2.0, 1.0, 1.0, 0.02),
        (5.0, 0.3, 1.0, 0.06),
        (10.0, 0.1, 0.87, 0.08),
        (17.0, 0.05, 0.7, 0.06),
    ],
)
def test_its_bandwidth_is_what_the_configuration_says(
    frequency_Hz: float, amplitude_mm: float, gain: float, within: float
) -> None:
    """The delay is the declared lag up to 10 Hz; -3 dB is near 18 Hz at 100 moves a second."""
    bench = ZaberBench()
    axis = following(bench)
    seconds, places, wanted = max(1.0, 3 / frequency_Hz), [], []

    def sine(at_s: float) -> float:
        places.append(bench.bench.axis.position_mm)
        wanted.append(START_MM + amplitude_mm * math.sin(2 * math.pi * frequency_Hz * at_s))
        return wanted[-1]

    led(bench, axis, sine, seconds)
    last = slice(-round(1000 / frequency_Hz) * max(1, int(seconds * frequency_Hz / 2)), None)
    turn = np.exp(-2j * np.pi * frequency_Hz * np.arange(len(places)) * 1e-3)[last]
    response = (turn @ (np.array(places)[last] - START_MM)) / (turn @ (np.array(wanted)[last] - START_MM))
    assert abs(response) == pytest.approx(gain, abs=within)
    if frequency_Hz <= 10:
        lag_ms = -np.angle(response) / (2 * np.pi * frequency_Hz) * 1e3
        assert lag_ms == pytest.approx(ZaberWiring().lag_ms, abs=2.5)


def test_it_reports_a_hundred_times_a_second_where_it_was_and_how_fast() -> None:
    bench = ZaberBench()
    axis = following(bench)
    samples = led(bench, axis, lambda at_s: START_MM + 5.0 * at_s, 2.0)
    assert len(samples) == pytest.approx(200, abs=3)
    assert [sample.seq for sample in samples] == list(range(len(samples)))
    assert all(sample.capture_ns <= sample.arrival_ns for sample in samples)
    late = samples[100:]
    assert [sample.velocity_mm_s for sample in late] == pytest.approx([5.0] * len(late), abs=0.5)
    # Dated when the device has the question: 5 ms/s of way in the line's 3 ms are 0.015 mm.
    again_mm = [late[0].position_mm + 5.0 * (sample.capture_ns - late[0].capture_ns) * 1e-9 for sample in late]
    assert [sample.position_mm for sample in late] == pytest.approx(again_mm, abs=0.05)
    assert decode_state(late[-1].status) is PdsState.ENABLED
    assert axis.counters.device_lost == 0 and axis.counters.checksum_errors == 0


@pytest.mark.parametrize("speed_mm_s", [10.0, 30.0])
def test_when_the_host_dies_it_stands_within_the_stated_way(speed_mm_s: float) -> None:
    bench = ZaberBench()
    axis = following(bench)
    led(bench, axis, lambda at_s: START_MM + speed_mm_s * at_s, 0.5)
    # What was told last reaches four periods ahead of where the axis is, and as far as it lags behind its set-point.
    told_mm = START_MM + speed_mm_s * 0.5
    died_mm = bench.bench.axis.position_mm
    bench.run_until(bench.clock.now_ns + 1_000 * MS)
    ran_on_mm = bench.bench.axis.position_mm - died_mm
    lag_mm = speed_mm_s * 0.025
    assert ran_on_mm <= run_on_mm(speed_mm_s, 0.01) + lag_mm + 0.05
    assert bench.bench.axis.position_mm < told_mm + run_on_mm(speed_mm_s, 0.01)
    assert bench.bench.axis.velocity_mm_s == pytest.approx(0.0, abs=0.01)


def test_a_move_at_a_speed_would_not_have_ended() -> None:
    """The plant: the same host on `move vel`, which the driver never sends."""
    bench = ZaberBench()
    axis = following(bench)
    bench.write(axis._started().sent("move vel 30000")[1])
    bench.run_until(bench.clock.now_ns + 1_000 * MS)
    assert bench.bench.axis.position_mm > START_MM + 8.0
    assert not [line for line in bench.commands[:-1] if b"move vel" in line]


def test_a_quick_stop_brakes_by_the_ramp_and_stays() -> None:
    bench = ZaberBench()
    axis = following(bench)
    led(bench, axis, lambda at_s: START_MM + 30.0 * at_s, 0.5)
    before_mm = bench.bench.axis.position_mm
    axis.quick_stop()
    assert not axis.enabled
    samples = idle(bench, axis, 0.5)
    # 30 mm/s at 2000 mm/s2 take 0.225 mm; the line and the position loop some milliseconds before that.
    assert bench.bench.axis.position_mm - before_mm < 0.8
    assert decode_state(samples[-1].status) is PdsState.QUICK_STOP
    stood_mm = bench.bench.axis.position_mm
    led(bench, axis, lambda _: START_MM, 0.3)
    assert bench.bench.axis.position_mm == pytest.approx(stood_mm, abs=0.01)


def test_a_stop_that_was_lost_on_the_line_is_said_again() -> None:
    bench = ZaberBench()
    axis = following(bench)
    led(bench, axis, lambda at_s: START_MM + 10.0 * at_s, 0.3)
    axis.quick_stop()
    bench._under_way.clear()
    before = len(bench.commands)
    idle(bench, axis, 0.3)
    assert [line for line in bench.commands[before:] if b" stop" in line]
    assert bench.bench.axis.velocity_mm_s == pytest.approx(0.0, abs=0.01)


def test_a_stall_is_a_fault_in_words_and_is_cleared_by_a_reset() -> None:
    bench = ZaberBench()
    axis = following(bench)
    bench.mock.raise_flag("FS")
    samples = led(bench, axis, lambda _: START_MM, 0.1)
    assert axis.fault == "FS: stalled and stopped" and not axis.enabled and not samples[-1].valid
    bench.baud = 0
    axis.reset_fault()
    axis.enable()
    assert following_well(axis)


def test_an_axis_that_restarted_has_no_reference_and_says_so() -> None:
    bench = ZaberBench()
    axis = following(bench)
    bench.mock.restart()
    led(bench, axis, lambda _: START_MM, 0.1)
    assert (axis.referenced, axis.fault) == (False, "it lost its reference, as after a restart")
    bench.baud = 0
    axis.quick_stop()
    with pytest.raises(DeviceError, match="has no reference, and enabling needs one"):
        axis.enable()


def test_a_set_point_that_is_refused_is_a_fault() -> None:
    bench = ZaberBench()
    axis = following(bench)
    bench.mock.settings.values["limit.max"] = 18_000
    led(bench, axis, lambda _: START_MM, 0.1)
    assert axis.fault == "it refused a set-point: BADDATA: a value is out of its range"


def test_beyond_the_limits_nothing_is_sent() -> None:
    bench = ZaberBench()
    axis = following(bench)
    before = len(bench.commands)
    with pytest.raises(SafetyStop, match="refused to go to 61 mm"):
        axis.command(61.0, bench.clock.now_ns + 100 * MS)
    bench.baud = 0
    with pytest.raises(SafetyStop, match="refused to move at 61 mm/s"):
        axis.move_to(10.0, 61.0)
    assert not [line for line in bench.commands[before:] if b"move" in line]


def test_an_interruption_stops_a_move() -> None:
    bench = ZaberBench()
    axis = homed(bench)
    answers = iter([False, False, True])
    axis._interrupted = lambda: next(answers, True)
    with pytest.raises(SafetyStop, match="stopped on request while it was moved"):
        axis.move_to(40.0, 20.0)
    bench.run_until(bench.clock.now_ns + 500 * MS)
    assert bench.bench.axis.position_mm < 5.0 and not bench.mock.motion.busy


def test_power_goes_and_comes_back() -> None:
    bench = ZaberBench()
    axis = following(bench)
    axis.power_off()
    samples = idle(bench, axis, 0.1)
    assert not bench.bench.axis.powered and decode_state(samples[-1].status) is PdsState.SWITCH_ON_DISABLED
    bench.baud = 0
    axis.enable()
    assert bench.mock.motion.flag != "FO" and following_well(axis)


def test_a_silent_axis_is_lost_after_half_a_second() -> None:
    bench = ZaberBench()
    axis = following(bench)
    bench.mock.silent = True
    with pytest.raises(DeviceError, match=r"no reply for 0.5 s; check its power"):
        led(bench, axis, lambda _: START_MM, 1.0)


def test_damaged_replies_are_counted_and_survived() -> None:
    bench = ZaberBench()
    axis = following(bench)
    bench.mock.corrupt_every = 10
    samples = led(bench, axis, lambda at_s: START_MM + at_s, 1.0)
    assert axis.counters.checksum_errors > 10 and axis.fault == ""
    assert len(samples) > 80


def test_set_up_repeats_a_damaged_reply() -> None:
    bench = ZaberBench()
    axis = bench.axis()
    axis.start()
    axis.close()
    bench.mock.corrupt_every = 9
    axis.start()
    assert axis.counters.checksum_errors > 0


def test_old_firmware_is_refused() -> None:
    bench = ZaberBench()
    bench.mock.old = True
    with pytest.raises(DeviceError, match=r"firmware '6.28' gives a move no speed of its own; 7 or newer"):
        bench.axis().start()


def test_it_is_not_asked_before_its_start() -> None:
    with pytest.raises(DeviceError, match="is not started or was closed"):
        ZaberBench().axis().poll(0)


def test_a_rate_that_the_line_cannot_carry_is_refused_in_the_configuration() -> None:
    with pytest.raises(ValueError, match="9600 baud carry 11 moves and positions a second"):
        ZaberWiring(port="/dev/ttyUSB0", baud=9600)
    assert ZaberWiring(port="tcp://stage:55550", baud=9600).rate_Hz == 100.0


def test_home_leads_outward_only_where_positions_grow_into_the_tissue() -> None:
    assert ZaberWiring().homes_outward and not ZaberWiring(direction=-1).homes_outward


def test_who_only_asks_who_is_there_writes_no_setting_and_stops_nothing() -> None:
    """Settings outlive the power, and whoever looks for a device does not know its scale."""
    bench = ZaberBench()
    asked = bench.axis(Limits(position_min_mm=1.0, position_max_mm=40.0)).identify()
    assert (asked.product, asked.serial, asked.firmware) == ("zaber-ascii", "68123", "7.40")
    assert bench.commands and all(b" get " in line or line.split()[1:2] == [b"get"] for line in bench.commands)
