"""Stops, faults, heartbeats, losses and strangers: sessions of the servo axis on a clock that only waiting moves."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.slcan import CanFrame, encode_frame
from drivers.epos4.device import Epos4Axis
from mock_devices.canopen.sdo_server import SdoAbort
from mock_devices.interfaces import NEVER_NS
from mock_devices.testing.epos4 import DriveBench, HostDied
from rig.channels import AxisSample
from rig.errors import DeviceError
from tests.drivers.epos4.sessions import axis_on, tick


def test_a_quick_stop_brakes_by_the_ramp_and_holds(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(10, 30)
    homed.enable()
    position_mm = 10.0
    for _ in range(200):
        position_mm += 0.05
        tick(stage, homed, position_mm)
    assert stage.plant.velocity_mm_s == pytest.approx(50, abs=2)
    homed.quick_stop()
    assert not homed.enabled
    for _ in range(100):
        tick(stage, homed, position_mm)
    assert stage.plant.velocity_mm_s == pytest.approx(0, abs=0.01)
    assert stage.plant.powered
    overrun_mm = stage.plant.position_mm - position_mm
    assert 0 < overrun_mm < 50**2 / 2 / 2000 + 0.1


def test_after_a_quick_stop_set_points_move_nothing_until_it_is_enabled_again(
    stage: DriveBench, homed: Epos4Axis
) -> None:
    homed.enable()
    homed.quick_stop()
    for _ in range(50):
        tick(stage, homed, 1.0)
    assert stage.plant.position_mm == pytest.approx(0, abs=0.05)
    homed.enable()
    assert homed.enabled
    for _ in range(200):
        tick(stage, homed, 1.0)
    assert stage.plant.position_mm == pytest.approx(1.0, abs=0.01)


def test_powered_off_it_has_no_torque_until_it_is_enabled_again(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    homed.power_off()
    enabled = [homed.enabled]
    for _ in range(50):
        tick(stage, homed, 1.0)
    powered = [stage.plant.powered]
    homed.enable()
    assert [*enabled, homed.enabled] == [False, True]
    assert [*powered, stage.plant.powered] == [False, True]


def test_a_step_beyond_the_window_is_a_following_error_and_the_axis_stops(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(10, 30)
    homed.enable()
    tick(stage, homed, 15.0)
    samples = tick(stage, homed, 15.0) + tick(stage, homed, 15.0)
    assert homed.fault == "0x8611 following error"
    assert not samples[-1].valid
    assert not homed.enabled
    stage.run(0.09)
    assert not stage.plant.powered
    assert stage.plant.position_mm < 12.5


def test_a_fault_is_reset_only_when_asked_and_then_the_axis_works_again(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    stage.mock.inject_fault(0x2310)
    for _ in range(20):
        tick(stage, homed, 0.0)
    assert homed.fault == "0x2310 overcurrent"
    with pytest.raises(DeviceError, match=r"is not operation enabled: the drive is in fault.*0x2310 overcurrent"):
        homed.enable()
    homed.reset_fault()
    assert not homed.fault
    assert not stage.plant.powered
    homed.enable()
    assert homed.enabled
    tick(stage, homed, 0.0)
    assert tick(stage, homed, 0.0)[0].valid


def test_resetting_waits_for_a_heartbeat_only_where_the_drive_left_operational(
    stage: DriveBench, homed: Epos4Axis
) -> None:
    stage.mock.inject_fault(0x2310)
    begun_ns = stage.now()
    homed.reset_fault()
    assert stage.now() - begun_ns < 5_000_000
    homed.request(stage.now())
    assert len(homed.poll(stage.now())) == 1


def test_a_fault_whose_cause_stays_is_not_reset(stage: DriveBench, homed: Epos4Axis) -> None:
    stage.mock.inject_fault(0x8A88, lasting=True)
    with pytest.raises(DeviceError, match="the fault is still there: 0x8A88 safe torque off; remove its cause"):
        homed.reset_fault()
    assert homed.fault == "0x8A88 safe torque off"
    stage.mock.inject_fault(0)
    homed.reset_fault()
    assert homed.fault == ""


def test_resetting_without_a_fault_only_takes_the_torque(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.reset_fault()
    assert homed.fault == ""
    assert not stage.plant.powered


def test_a_fault_during_a_move_ends_it_with_its_name(stage: DriveBench, homed: Epos4Axis) -> None:
    stage.plant.stop_mm = 0.0
    homed.move_to(5, 30)
    stage.plant.stop_mm = 4.0
    with pytest.raises(DeviceError, match=r"1 mm at 10 mm/s was not reached: 0x8611 following error"):
        homed.move_to(1, 10)


def test_a_fault_during_homing_ends_it_with_its_name(stage: DriveBench, axis: Epos4Axis) -> None:
    stage.plant.stop_mm = 5.0
    with pytest.raises(DeviceError, match=r"homing by method 17 found no reference .*0x8611 following error"):
        axis.home()


def test_a_host_that_falls_silent_makes_the_drive_stop_by_itself(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(10, 30)
    homed.enable()
    tick(stage, homed, 10.0)
    powered = []
    for silence_s in (0.045, 0.1):
        stage.run(silence_s)
        powered.append(stage.plant.powered)
    assert powered == [True, False]
    homed.poll(stage.now())
    assert homed.fault == "0x8130 the host's heartbeat was missing"
    homed.reset_fault()
    homed.enable()
    assert homed.enabled


@pytest.mark.parametrize("move", [Epos4Axis.home, lambda axis: axis.move_to(50, 50)])
def test_a_host_that_dies_during_a_move_stops_the_axis(
    stage: DriveBench, homed: Epos4Axis, move: Callable[[Epos4Axis], None]
) -> None:
    homed.move_to(30, 50)
    stage.dies_at_ns = stage.now() + 100_000_000
    with pytest.raises(HostDied):
        move(homed)
    stage.run(0.2)
    assert stage.mock.dictionary.value(0x603F) == 0x8130
    assert not stage.plant.powered
    assert 25 < stage.plant.position_mm < 45
    stage.dies_at_ns = NEVER_NS


def test_the_drive_does_not_watch_the_host_before_the_first_poll(stage: DriveBench, axis: Epos4Axis) -> None:
    stage.run(5.0)
    axis.poll(stage.now())
    assert axis.fault == ""
    stage.run(0.2)
    axis.poll(stage.now())
    assert axis.fault == "0x8130 the host's heartbeat was missing"


def test_a_silent_drive_is_lost_after_three_heartbeats(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    tick(stage, homed, 0.0)
    stage.mock.silent = True
    for _ in range(140):
        tick(stage, homed, 0.0)
    with pytest.raises(DeviceError, match=r"its heartbeat is missing for 1[5-9]\d ms, expected every 50 ms"):
        for _ in range(60):
            tick(stage, homed, 0.0)


def test_a_drive_that_restarts_by_itself_is_an_error(stage: DriveBench, homed: Epos4Axis) -> None:
    stage.send(CanFrame(0, b"\x81\x01"))
    stage.run(0.06)
    with pytest.raises(DeviceError, match="restarted by itself and lost its limits"):
        homed.poll(stage.now())


def test_a_cut_cable_is_one_sentence_and_closing_does_not_raise(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    stage.cut = True
    with pytest.raises(DeviceError, match="the CAN adapter is gone"):
        homed.poll(stage.now())
    with pytest.raises(DeviceError, match="the CAN adapter is gone"):
        homed.command(0.0, stage.now())
    homed.close()
    assert stage.closed


def test_lost_answers_are_counted_and_numbers_stay_contiguous(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    samples = []
    for step in range(1000):
        if step in (300, 600):
            stage.drop = 2
        samples += tick(stage, homed, 0.0)
    assert homed.counters.device_lost == 2
    assert len(samples) == 999 - 2
    assert [sample.seq for sample in samples] == list(range(997))


def test_what_the_adapter_refuses_is_counted(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    stage.say(b"nonsense\r")
    tick(stage, homed, 0.0)
    tick(stage, homed, 0.0)
    assert homed.counters.device_lost == 1


def test_a_position_that_stands_still_is_reported_as_it_is(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(10, 30)
    homed.enable()
    stage.mock.frozen = True
    positions = {sample.position_mm for _ in range(50) for sample in tick(stage, homed, 10.4)}
    assert len(positions) == 1
    assert stage.plant.position_mm == pytest.approx(10.4, abs=0.05)


def test_a_silent_node_is_one_sentence(stage: DriveBench) -> None:
    stage.mock.silent = True
    with pytest.raises(DeviceError, match=r"servo axis on memory, node 1: does not answer: reading object 1018:01"):
        axis_on(stage).start()
    assert stage.closed


def test_a_drive_that_still_boots_is_waited_for() -> None:
    stage = DriveBench(booted=False)
    axis = axis_on(stage)
    axis.start()
    assert axis.identity.serial == "62014711"
    axis.close()


def test_another_node_number_is_a_silent_node(stage: DriveBench) -> None:
    with pytest.raises(DeviceError, match="node 2: does not answer"):
        axis_on(stage, node=2).start()


def test_another_device_is_named_and_left_alone(stage: DriveBench) -> None:
    stage.mock.wrong_identity = True
    with pytest.raises(DeviceError, match=r"is not a maxon EPOS4: .* vendor 0x24a, product 0x00010002 instead of 0xfb"):
        axis_on(stage).start()
    writes = [frame for frame in stage.sent if frame.can_id == 0x601 and frame.data[0] >> 5 == 1]
    assert writes == []
    assert stage.closed


def test_a_drive_without_cyclic_positions_is_refused(stage: DriveBench) -> None:
    stage.mock.dictionary.values[0x6502, 0] = 0x325
    with pytest.raises(DeviceError, match=r"lacks modes \[8\] \(object 6502 is 0x325\)"):
        axis_on(stage).start()


def test_a_limit_the_drive_does_not_keep_is_noticed(stage: DriveBench) -> None:
    stage.mock.dictionary.live[0x607D, 2] = lambda: 2_000_000
    with pytest.raises(DeviceError, match=r"object 607D:02 .* was set to 121000 and reads back as 2000000"):
        axis_on(stage).start()
    assert not stage.plant.powered


def test_a_parameter_the_drive_refuses_is_named(stage: DriveBench) -> None:
    def refuse(_value: int) -> None:
        raise SdoAbort(0x06090030)

    stage.mock.dictionary.hooks[0x6085, 0] = refuse
    with pytest.raises(DeviceError, match=r"refused writing 24000 to object 6085:00 .*: 06090030 value out of range"):
        axis_on(stage).start()


def test_a_fault_from_before_is_known_after_start(stage: DriveBench) -> None:
    stage.mock.inject_fault(0x3210)
    axis = axis_on(stage)
    axis.start()
    assert axis.fault == "0x3210 supply voltage too high"
    axis.reset_fault()
    axis.home()
    axis.close()


def test_starting_finds_a_moving_axis_and_stops_it_first(stage: DriveBench) -> None:
    first = axis_on(stage)
    first.start()
    first.home()
    first.enable()
    second = axis_on(stage)
    second.start()
    assert not stage.plant.powered
    second.close()


def test_closing_stops_a_moving_axis_takes_the_torque_and_ends_the_watch(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    for step in range(200):
        tick(stage, homed, 0.05 * step)
    homed.close()
    assert not stage.plant.powered
    assert stage.plant.velocity_mm_s == pytest.approx(0, abs=0.5)
    assert stage.mock.dictionary.values[0x1016, 1] == 0
    homed.close()
    stage.run(1.0)
    assert stage.mock.dictionary.value(0x603F) == 0


def test_a_closed_or_unstarted_axis_says_so(stage: DriveBench, axis: Epos4Axis) -> None:
    axis.close()
    for call in (axis.home, axis.enable, axis.quick_stop, axis.fileno, lambda: axis.poll(0)):
        with pytest.raises(DeviceError, match="is not started or was closed"):
            call()
    assert axis.fault == ""
    assert not axis.enabled


STRANGE = st.builds(CanFrame, st.sampled_from((0x081, 0x181, 0x281, 0x381, 0x581, 0x701, 0x123)), st.binary(max_size=8))


@given(frames=st.lists(STRANGE, max_size=30), noise=st.binary(max_size=30))
def test_whatever_the_bus_brings_only_a_device_error_comes_out(frames: list[CanFrame], noise: bytes) -> None:
    stage = DriveBench()
    axis = axis_on(stage)
    axis.start()
    for frame in frames:
        stage.wire.sent += [encode_frame(frame), noise]
        stage.run(0.001)
        try:
            axis.poll(stage.now())
        except DeviceError as error:
            assert "restarted by itself" in str(error)
    axis.close()


def test_the_errors_a_drive_remembers_are_told_in_words_newest_first(stage: DriveBench, homed: Epos4Axis) -> None:
    assert homed.history() == ()
    stage.mock.inject_fault(0x2310)
    stage.mock.inject_fault(0x8611)
    assert homed.history() == ("0x8611 following error", "0x2310 overcurrent")


def test_a_drive_that_lost_its_power_has_no_reference_when_it_is_opened_again(
    stage: DriveBench, homed: Epos4Axis
) -> None:
    homed.enable()
    tick(stage, homed, 0.0)
    tick(stage, homed, 0.0)
    before = homed.referenced
    stage.mock.restart()
    with pytest.raises(DeviceError, match="restarted by itself"):
        for _ in range(100):
            tick(stage, homed, 0.0)
    homed.start()
    for _ in range(3):
        stage.run(0.001)
        homed.request(stage.now())
        homed.poll(stage.now())
    assert (before, homed.referenced, homed.enabled) == (True, False, False)


def test_numbers_go_on_where_the_driver_before_left_off(stage: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    last = [sample.seq for _ in range(5) for sample in tick(stage, homed, 0.0)][-1]
    homed.close()
    again = axis_on(stage)
    again.next_seq = last + 1
    again.start()
    samples: list[AxisSample] = []
    while not samples:
        stage.run(0.001)
        again.request(stage.now())
        samples = list(again.poll(stage.now()))
    assert samples[0].seq == last + 1
