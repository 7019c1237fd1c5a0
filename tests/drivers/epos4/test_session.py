"""Stops, faults, heartbeats, losses and strangers: sessions of the servo axis on a clock that only waiting moves."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.slcan import CanFrame, encode_frame
from drivers.epos4.device import Epos4Axis
from drivers.roles import OnBus
from mock_devices.canopen.sdo_server import SdoAbort
from mock_devices.interfaces import NEVER_NS
from mock_devices.testing.epos4 import DriveBench, HostDied
from rig.channels import AxisSample
from rig.errors import DeviceError
from tests.drivers.epos4.sessions import axis_on, tick


def test_a_quick_stop_brakes_by_the_ramp_and_holds(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(10, 30)
    homed.enable()
    position_mm = 10.0
    for _ in range(200):
        position_mm += 0.05
        tick(bench, homed, position_mm)
    assert bench.plant.velocity_mm_s == pytest.approx(50, abs=2)
    homed.quick_stop()
    assert not homed.enabled
    for _ in range(100):
        tick(bench, homed, position_mm)
    assert bench.plant.velocity_mm_s == pytest.approx(0, abs=0.01)
    assert bench.plant.powered
    overrun_mm = bench.plant.position_mm - position_mm
    assert 0 < overrun_mm < 50**2 / 2 / 2000 + 0.1


def test_after_a_quick_stop_set_points_move_nothing_until_it_is_enabled_again(
    bench: DriveBench, homed: Epos4Axis
) -> None:
    homed.enable()
    homed.quick_stop()
    for _ in range(50):
        tick(bench, homed, 1.0)
    assert bench.plant.position_mm == pytest.approx(0, abs=0.05)
    homed.enable()
    assert homed.enabled
    for _ in range(200):
        tick(bench, homed, 1.0)
    assert bench.plant.position_mm == pytest.approx(1.0, abs=0.01)


def test_powered_off_it_has_no_torque_until_it_is_enabled_again(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    homed.power_off()
    enabled = [homed.enabled]
    for _ in range(50):
        tick(bench, homed, 1.0)
    powered = [bench.plant.powered]
    homed.enable()
    assert [*enabled, homed.enabled] == [False, True]
    assert [*powered, bench.plant.powered] == [False, True]


def test_a_step_beyond_the_window_is_a_following_error_and_the_axis_stops(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(10, 30)
    homed.enable()
    tick(bench, homed, 15.0)
    samples = tick(bench, homed, 15.0) + tick(bench, homed, 15.0)
    assert homed.fault == "0x8611 following error"
    assert not samples[-1].valid
    assert not homed.enabled
    bench.run(0.09)
    assert not bench.plant.powered
    assert bench.plant.position_mm < 12.5


def test_a_fault_is_reset_only_when_asked_and_then_the_axis_works_again(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    bench.mock.inject_fault(0x2310)
    for _ in range(20):
        tick(bench, homed, 0.0)
    assert homed.fault == "0x2310 overcurrent"
    with pytest.raises(DeviceError, match=r"is not operation enabled: the drive is in fault.*0x2310 overcurrent"):
        homed.enable()
    homed.reset_fault()
    assert not homed.fault
    assert not bench.plant.powered
    homed.enable()
    assert homed.enabled
    tick(bench, homed, 0.0)
    assert tick(bench, homed, 0.0)[0].valid


def test_resetting_waits_for_a_heartbeat_only_where_the_drive_left_operational(
    bench: DriveBench, homed: Epos4Axis
) -> None:
    bench.mock.inject_fault(0x2310)
    begun_ns = bench.now()
    homed.reset_fault()
    assert bench.now() - begun_ns < 5_000_000
    homed.request(bench.now())
    assert len(homed.poll(bench.now())) == 1


def test_a_fault_whose_cause_stays_is_not_reset(bench: DriveBench, homed: Epos4Axis) -> None:
    bench.mock.inject_fault(0x8A88, lasting=True)
    with pytest.raises(DeviceError, match="the fault is still there: 0x8A88 safe torque off; remove its cause"):
        homed.reset_fault()
    assert homed.fault == "0x8A88 safe torque off"
    bench.mock.inject_fault(0)
    homed.reset_fault()
    assert homed.fault == ""


def test_resetting_without_a_fault_only_takes_the_torque(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.reset_fault()
    assert homed.fault == ""
    assert not bench.plant.powered


def test_a_fault_during_a_move_ends_it_with_its_name(bench: DriveBench, homed: Epos4Axis) -> None:
    bench.plant.stop_mm = 0.0
    homed.move_to(5, 30)
    bench.plant.stop_mm = 4.0
    with pytest.raises(DeviceError, match=r"1 mm at 10 mm/s was not reached: 0x8611 following error"):
        homed.move_to(1, 10)


def test_a_fault_during_homing_ends_it_with_its_name(bench: DriveBench, axis: Epos4Axis) -> None:
    bench.plant.stop_mm = 5.0
    with pytest.raises(DeviceError, match=r"homing by method 17 found no reference .*0x8611 following error"):
        axis.home()


def test_a_host_that_falls_silent_makes_the_drive_stop_by_itself(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(10, 30)
    homed.enable()
    tick(bench, homed, 10.0)
    powered = []
    for silence_s in (0.045, 0.1):
        bench.run(silence_s)
        powered.append(bench.plant.powered)
    assert powered == [True, False]
    homed.poll(bench.now())
    assert homed.fault == "0x8130 the host's heartbeat was missing"
    homed.reset_fault()
    homed.enable()
    assert homed.enabled


@pytest.mark.parametrize("move", [Epos4Axis.home, lambda axis: axis.move_to(50, 50)])
def test_a_host_that_dies_during_a_move_stops_the_axis(
    bench: DriveBench, homed: Epos4Axis, move: Callable[[Epos4Axis], None]
) -> None:
    homed.move_to(30, 50)
    bench.dies_at_ns = bench.now() + 100_000_000
    with pytest.raises(HostDied):
        move(homed)
    bench.run(0.2)
    assert bench.mock.dictionary.value(0x603F) == 0x8130
    assert not bench.plant.powered
    assert 25 < bench.plant.position_mm < 45
    bench.dies_at_ns = NEVER_NS


def test_the_drive_does_not_watch_the_host_before_the_first_poll(bench: DriveBench, axis: Epos4Axis) -> None:
    bench.run(5.0)
    axis.poll(bench.now())
    assert axis.fault == ""
    bench.run(0.2)
    axis.poll(bench.now())
    assert axis.fault == "0x8130 the host's heartbeat was missing"


def test_a_silent_drive_is_lost_after_three_heartbeats(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    tick(bench, homed, 0.0)
    bench.mock.silent = True
    for _ in range(140):
        tick(bench, homed, 0.0)
    with pytest.raises(DeviceError, match=r"its heartbeat is missing for 1[5-9]\d ms, expected every 50 ms"):
        for _ in range(60):
            tick(bench, homed, 0.0)


def test_a_drive_that_restarts_by_itself_is_an_error(bench: DriveBench, homed: Epos4Axis) -> None:
    bench.send(CanFrame(0, b"\x81\x01"))
    bench.run(0.06)
    with pytest.raises(DeviceError, match="restarted by itself and lost its limits"):
        homed.poll(bench.now())


def test_a_cut_cable_is_one_sentence_and_closing_does_not_raise(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    bench.cut = True
    with pytest.raises(DeviceError, match="the CAN adapter is gone"):
        homed.poll(bench.now())
    with pytest.raises(DeviceError, match="the CAN adapter is gone"):
        homed.command(0.0, bench.now())
    homed.close()
    assert bench.closed


def test_lost_answers_are_counted_and_numbers_stay_contiguous(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    samples = []
    for step in range(1000):
        if step in (300, 600):
            bench.drop = 2
        samples += tick(bench, homed, 0.0)
    assert homed.counters.device_lost == 2
    assert len(samples) == 999 - 2
    assert [sample.seq for sample in samples] == list(range(997))


def test_what_the_adapter_refuses_is_counted(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    bench.say(b"nonsense\r")
    tick(bench, homed, 0.0)
    tick(bench, homed, 0.0)
    assert homed.counters.device_lost == 1


def test_a_position_that_stands_still_is_reported_as_it_is(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(10, 30)
    homed.enable()
    bench.mock.frozen = True
    positions = {sample.position_mm for _ in range(50) for sample in tick(bench, homed, 10.4)}
    assert len(positions) == 1
    assert bench.plant.position_mm == pytest.approx(10.4, abs=0.05)


def test_a_silent_node_is_one_sentence(bench: DriveBench) -> None:
    bench.mock.silent = True
    with pytest.raises(DeviceError, match=r"servo axis on memory, node 1: does not answer: reading object 1018:01"):
        axis_on(bench).start()
    assert bench.closed


def test_a_drive_that_still_boots_is_waited_for() -> None:
    bench = DriveBench(booted=False)
    axis = axis_on(bench)
    axis.start()
    assert axis.identity.serial == "62014711"
    axis.close()


def test_another_node_number_is_a_silent_node(bench: DriveBench) -> None:
    with pytest.raises(DeviceError, match="node 2: does not answer"):
        axis_on(bench, node=2).start()


def test_another_device_is_named_and_left_alone(bench: DriveBench) -> None:
    bench.mock.wrong_identity = True
    with pytest.raises(DeviceError, match=r"is not a maxon EPOS4: .* vendor 0x24a, product 0x00010002 instead of 0xfb"):
        axis_on(bench).start()
    writes = [frame for frame in bench.sent if frame.can_id == 0x601 and frame.data[0] >> 5 == 1]
    assert writes == []
    assert bench.closed


def test_a_drive_without_cyclic_positions_is_refused(bench: DriveBench) -> None:
    bench.mock.dictionary.values[0x6502, 0] = 0x325
    with pytest.raises(DeviceError, match=r"lacks modes \[8\] \(object 6502 is 0x325\)"):
        axis_on(bench).start()


def test_a_limit_the_drive_does_not_keep_is_noticed(bench: DriveBench) -> None:
    bench.mock.dictionary.live[0x607D, 2] = lambda: 2_000_000
    with pytest.raises(DeviceError, match=r"object 607D:02 .* was set to 121000 and reads back as 2000000"):
        axis_on(bench).start()
    assert not bench.plant.powered


def test_a_parameter_the_drive_refuses_is_named(bench: DriveBench) -> None:
    def refuse(_value: int) -> None:
        raise SdoAbort(0x06090030)

    bench.mock.dictionary.hooks[0x6085, 0] = refuse
    with pytest.raises(DeviceError, match=r"refused writing 24000 to object 6085:00 .*: 06090030 value out of range"):
        axis_on(bench).start()


def test_a_fault_from_before_is_known_after_start(bench: DriveBench) -> None:
    bench.mock.inject_fault(0x3210)
    axis = axis_on(bench)
    axis.start()
    assert axis.fault == "0x3210 supply voltage too high"
    axis.reset_fault()
    axis.home()
    axis.close()


def test_starting_finds_a_moving_axis_and_stops_it_first(bench: DriveBench) -> None:
    first = axis_on(bench)
    first.start()
    first.home()
    first.enable()
    second = axis_on(bench)
    second.start()
    assert not bench.plant.powered
    second.close()


def test_closing_stops_a_moving_axis_takes_the_torque_and_ends_the_watch(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    for step in range(200):
        tick(bench, homed, 0.05 * step)
    homed.close()
    assert not bench.plant.powered
    assert bench.plant.velocity_mm_s == pytest.approx(0, abs=0.5)
    assert bench.mock.dictionary.values[0x1016, 1] == 0
    homed.close()
    bench.run(1.0)
    assert bench.mock.dictionary.value(0x603F) == 0


def test_a_closed_or_unstarted_axis_says_so(bench: DriveBench, axis: Epos4Axis) -> None:
    axis.close()
    for call in (axis.home, axis.enable, axis.quick_stop, axis.fileno, lambda: axis.poll(0)):
        with pytest.raises(DeviceError, match="is not started or was closed"):
            call()
    assert axis.fault == ""
    assert not axis.enabled


STRANGE = st.builds(CanFrame, st.sampled_from((0x081, 0x181, 0x281, 0x381, 0x581, 0x701, 0x123)), st.binary(max_size=8))


@given(frames=st.lists(STRANGE, max_size=30), noise=st.binary(max_size=30))
def test_whatever_the_bus_brings_only_a_device_error_comes_out(frames: list[CanFrame], noise: bytes) -> None:
    bench = DriveBench()
    axis = axis_on(bench)
    axis.start()
    for frame in frames:
        bench.wire.sent += [encode_frame(frame), noise]
        bench.run(0.001)
        try:
            axis.poll(bench.now())
        except DeviceError as error:
            assert "restarted by itself" in str(error)
    axis.close()


def test_the_errors_a_drive_remembers_are_told_in_words_newest_first(bench: DriveBench, homed: Epos4Axis) -> None:
    assert homed.history() == ()
    bench.mock.inject_fault(0x2310)
    bench.mock.inject_fault(0x8611)
    assert homed.history() == ("0x8611 following error", "0x2310 overcurrent")


def test_a_drive_that_lost_its_power_has_no_reference_when_it_is_opened_again(
    bench: DriveBench, homed: Epos4Axis
) -> None:
    homed.enable()
    tick(bench, homed, 0.0)
    tick(bench, homed, 0.0)
    before = homed.referenced
    bench.mock.restart()
    with pytest.raises(DeviceError, match="restarted by itself"):
        for _ in range(100):
            tick(bench, homed, 0.0)
    homed.start()
    for _ in range(3):
        bench.run(0.001)
        homed.request(bench.now())
        homed.poll(bench.now())
    assert (before, homed.referenced, homed.enabled) == (True, False, False)


def test_numbers_go_on_where_the_driver_before_left_off(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    last = [sample.seq for _ in range(5) for sample in tick(bench, homed, 0.0)][-1]
    homed.close()
    again = axis_on(bench)
    again.next_seq = last + 1
    again.start()
    samples: list[AxisSample] = []
    while not samples:
        bench.run(0.001)
        again.request(bench.now())
        samples = list(again.poll(bench.now()))
    assert samples[0].seq == last + 1


def test_who_only_asks_who_is_there_writes_no_object_and_leaves_the_node_in_its_state(bench: DriveBench) -> None:
    state = bench.mock.nmt
    assert axis_on(bench).identify().product == "maxon EPOS4 61500000"
    uploads = {frame.data[0] & 0xE0 for frame in bench.sent}
    assert uploads <= {0x40, 0x60}  # CiA 301: initiate an upload, and a segment of it
    assert {frame.can_id for frame in bench.sent} == {0x601}
    assert (bench.mock.nmt, bench.closed) == (state, True)


def test_the_load_of_the_bus_is_told(bench: DriveBench) -> None:
    axis = axis_on(bench)
    with pytest.raises(DeviceError, match="not started"):
        _ = axis.bus
    axis.start()
    bench.health.load, bench.health.error_frames = 0.31, 2
    assert isinstance(axis, OnBus)
    assert axis.bus == "CAN 1000 kbit/s, load 31%, 2 error frames, 0 refused, 0 dropped, error active"
