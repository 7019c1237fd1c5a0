"""The state of a device, one observation after another; times are the ones stated beside the thresholds."""

import pytest

from controller.devices.states import (
    NEXT_STEPS,
    DeviceState,
    DeviceStatus,
    Observation,
    connecting,
    following,
    refusal,
)

S = 1_000_000_000
MS = 1_000_000
WELL = Observation(age_ns=2 * MS)


def after(*seen: tuple[float, Observation], before: DeviceStatus | None = None) -> DeviceStatus:
    """The status once all of ``seen`` (second, observation) was observed."""
    status = before or connecting(0)
    for at_s, observation in seen:
        status = following(status, observation, round(at_s * S))
    return status


def test_a_device_is_told_by_the_words_that_status_and_page_show() -> None:
    assert [str(state) for state in DeviceState] == ["connecting", "ok", "degraded", "lost", "reconnecting", "fault"]


def test_the_first_sample_makes_a_device_ok() -> None:
    assert after((0.1, Observation(None))).state is DeviceState.CONNECTING
    assert after((0.1, Observation(None)), (0.2, WELL)) == DeviceStatus(DeviceState.OK, "", round(0.2 * S))


def test_a_device_that_never_speaks_is_lost_after_five_seconds() -> None:
    assert after((4.9, Observation(None))).state is DeviceState.CONNECTING
    late = after((5.0, Observation(None)))
    assert (late.state, late.detail) == (DeviceState.LOST, "no sample within 5 s of its start")
    assert after((5.0, Observation(None)), (9.0, Observation(None))).since_ns == 5 * S


@pytest.mark.parametrize(("age_s", "state"), [(1.0, DeviceState.OK), (1.001, DeviceState.LOST)])
def test_silence_of_more_than_a_second_is_a_loss(age_s: float, state: DeviceState) -> None:
    assert after((1.0, WELL), (9.0, Observation(round(age_s * S)))).state is state


def test_a_sample_ends_a_silence() -> None:
    assert after((1.0, WELL), (9.0, Observation(2 * S)), (9.1, WELL)).state is DeviceState.OK


def test_samples_that_are_not_as_they_should_be_degrade_after_a_second_without_a_good_one() -> None:
    slow = Observation(2 * MS, imperfect="412 Hz instead of 1000 Hz")
    assert after((1.0, WELL), (2.0, slow), (2.999, slow)).state is DeviceState.OK
    degraded = after((1.0, WELL), (2.0, slow), (3.0, slow))
    assert degraded == DeviceStatus(DeviceState.DEGRADED, "412 Hz instead of 1000 Hz", 3 * S, 2 * S)
    assert after((1.0, WELL), (2.0, slow), (2.5, WELL), (3.4, slow)).state is DeviceState.OK
    assert after((3.1, WELL), before=degraded).state is DeviceState.OK


def test_orders_that_are_withheld_degrade_at_once() -> None:
    assert after((1.0, WELL), (1.001, Observation(MS, withheld="no torque"))).state is DeviceState.DEGRADED


def test_a_loss_a_reconnection_and_the_way_back() -> None:
    gone = Observation(2 * S, lost="the line is gone")
    lost = after((1.0, WELL), (2.0, gone))
    assert (lost.state, lost.detail, lost.since_ns) == (DeviceState.LOST, "the line is gone", 2 * S)
    trying = after((3.0, Observation(3 * S, lost="the line is gone", reopening=True)), before=lost)
    assert (trying.state, trying.detail) == (DeviceState.RECONNECTING, "the line is gone")
    back = after((4.0, Observation(None)), before=trying)
    assert (back.state, back.since_ns) == (DeviceState.CONNECTING, 4 * S)
    assert after((4.1, WELL), before=back).state is DeviceState.OK


def test_a_fault_outranks_everything_else() -> None:
    worst = Observation(None, fault="overcurrent", lost="gone", reopening=True, withheld="off", imperfect="slow")
    assert after((1.0, WELL), (2.0, worst)) == DeviceStatus(DeviceState.FAULT, "overcurrent", 2 * S, 2 * S)


def test_a_refusal_names_the_first_device_that_is_needed_and_not_ok_and_the_next_step() -> None:
    devices = {
        "force": DeviceStatus(DeviceState.OK, "", 0),
        "axis": DeviceStatus(DeviceState.FAULT, "0x8130 the host's heartbeat was missing", 0),
        "tracker": DeviceStatus(DeviceState.LOST, "the line is gone", 0),
    }
    assert refusal(devices, ("force",)) == ""
    assert refusal(devices, devices) == (
        "axis is fault: 0x8130 the host's heartbeat was missing; `rig reset` says what happened and recovers"
    )
    assert refusal(devices, ("tracker",)).startswith("tracker is lost: the line is gone; check its power and cable")


@pytest.mark.parametrize("state", [state for state in DeviceState if state is not DeviceState.OK])
def test_every_state_that_refuses_has_a_next_step(state: DeviceState) -> None:
    assert refusal({"force": DeviceStatus(state, "why", 0)}, ["force"]).endswith(NEXT_STEPS[state])


def test_a_silence_is_told_with_its_bound() -> None:
    assert after((1.0, WELL), (9.0, Observation(2 * S))).detail == "no sample for more than 1 s"


def test_a_device_that_was_opened_late_has_its_five_seconds_too() -> None:
    begun = connecting(1000 * S)
    assert after((1004.9, Observation(None)), before=begun).state is DeviceState.CONNECTING
    assert after((1005.0, Observation(None)), before=begun).state is DeviceState.LOST
