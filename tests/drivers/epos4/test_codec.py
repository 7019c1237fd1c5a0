"""PDOs, units, the object table and what is written before anything moves."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.epos4 import objects
from drivers.epos4.codec import (
    DriveMotion,
    DriveState,
    Units,
    decode_motion_pdo,
    decode_state_pdo,
    encode_setpoint,
    pdo_maps,
)
from drivers.epos4.faults import FAULTS, describe
from drivers.epos4.kind import Epos4Kind
from drivers.epos4.setup import (
    agrees,
    drive_heartbeat_limit_ns,
    drive_limits,
    expected,
    host_heartbeat_limit_ms,
    host_node,
    parameters,
    process_data,
)
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits

SCREW = Units(increments_per_mm=2000, increments_per_rev=10_000)


def test_the_set_point_is_controlword_and_position() -> None:
    assert encode_setpoint(0x0F, 20_000) == bytes.fromhex("0F 00 20 4E 00 00")
    assert encode_setpoint(0x0B, -1) == bytes.fromhex("0B 00 FF FF FF FF")


def test_the_drive_answers_state_and_motion() -> None:
    assert decode_state_pdo(bytes.fromhex("37 16 20 4E 00 00")) == DriveState(0x1637, 20_000)
    assert decode_motion_pdo(bytes.fromhex("C4 FF FF FF E8 03 00 00")) == DriveMotion(-60, 1000)


@pytest.mark.parametrize("size", [0, 5, 7, 9])
def test_answers_of_another_length_are_none(size: int) -> None:
    assert decode_state_pdo(bytes(size)) is None
    assert decode_motion_pdo(bytes(size)) is None


def test_one_turn_a_second_on_a_5_mm_screw_is_60_rpm_and_5_mm_s() -> None:
    assert SCREW.rpm(5) == 60
    assert SCREW.mm_s(-60) == -5
    assert SCREW.increments(1.5) == 3000
    assert SCREW.mm(-3000) == -1.5
    assert SCREW.length(-2) == 4000


def test_windows_and_speeds_are_never_0_which_would_switch_them_off() -> None:
    assert SCREW.rpm(1e-9) == 1
    assert SCREW.length(0) == 1


def test_an_axis_mounted_the_other_way_round_only_changes_signs() -> None:
    turned = Units(2000, 10_000, direction=-1)
    assert turned.increments(1.5) == -3000
    assert turned.mm(-3000) == 1.5
    assert turned.mm_s(60) == -5
    assert turned.rpm(5) == 60


@given(position_mm=st.floats(-1000, 1000), per_mm=st.floats(10, 1e5), direction=st.sampled_from((1, -1)))
def test_a_position_comes_back_within_half_an_increment(position_mm: float, per_mm: float, direction: int) -> None:
    scale = Units(per_mm, 10_000, direction)
    assert abs(scale.mm(scale.increments(position_mm)) - position_mm) <= 0.5000001 / per_mm


def test_pdos_are_switched_off_cleared_filled_and_switched_on() -> None:
    setpoint = pdo_maps(5)[0]
    assert [(entry.index, entry.sub, value) for entry, value in setpoint.writes()] == [
        (0x1400, 1, 0x80000205),
        (0x1400, 2, 1),
        (0x1600, 0, 0),
        (0x1600, 1, 0x60400010),
        (0x1600, 2, 0x607A0020),
        (0x1600, 0, 2),
        (0x1400, 1, 0x00000205),
    ]


def test_every_other_pdo_is_switched_off() -> None:
    writes = expected(process_data(Epos4Wiring(node=5)))
    identifiers = {entry.index: value for entry, value in writes.items() if entry.name.endswith("identifier")}
    on = {index for index, value in identifiers.items() if not value & objects.DISABLED}
    assert set(identifiers) == {0x1400, 0x1401, 0x1402, 0x1403, 0x1800, 0x1801, 0x1802, 0x1803}
    assert on == {0x1400, 0x1800, 0x1801}


def test_limits_are_written_before_anything_else_and_the_watch_on_the_host_last() -> None:
    axis = Epos4Wiring(heartbeat_ms=50, current_limit_A=4, following_error_mm=1.5, acceleration_mm_s2=2000)
    limits = Limits(position_min_mm=2, position_max_mm=40, speed_mm_s=60)
    writes = [(entry.index, entry.sub, value) for entry, value in parameters(axis, limits, Epos4Kind(axis).scale)]
    assert writes[:8] == [
        (0x607D, 1, 3000),
        (0x607D, 2, 81_000),
        (0x607F, 0, 720),
        (0x6065, 0, 3000),
        (0x6085, 0, 24_000),
        (0x6083, 0, 24_000),
        (0x6084, 0, 24_000),
        (0x3001, 2, 4000),
    ]
    assert (0x6007, 0, 3) in writes
    assert (0x605A, 0, 6) in writes
    assert (0x605E, 0, 2) in writes
    assert (0x60C2, 1, 0) in writes
    assert writes[-1] == (0x1016, 1, 127 << 16 | 100)


def test_limits_of_a_turned_axis_change_places() -> None:
    limits = Limits(position_min_mm=0, position_max_mm=60)
    assert drive_limits(limits, Units(2000, 10_000)) == (-1000, 121_000)
    assert drive_limits(limits, Units(2000, 10_000, -1)) == (-121_000, 1000)


@pytest.mark.parametrize(("period_ms", "host_ms", "drive_ms"), [(5, 25, 25), (20, 40, 60), (50, 100, 150)])
def test_silence_is_lost_after_two_or_three_periods_and_20_ms_at_least(
    period_ms: int, host_ms: int, drive_ms: int
) -> None:
    axis = Epos4Wiring(heartbeat_ms=period_ms)
    assert host_heartbeat_limit_ms(axis) == host_ms
    assert drive_heartbeat_limit_ns(axis) == drive_ms * 1_000_000


def test_the_host_gives_way_where_the_drive_has_its_number() -> None:
    assert host_node(Epos4Wiring(node=1)) == 127
    assert host_node(Epos4Wiring(node=127)) == 126


def test_reading_back_an_identifier_may_show_the_flag_against_remote_requests() -> None:
    identifier = objects.OBJECTS[0x1800, 1]
    assert agrees(identifier, 0x181, 0x40000181)
    assert not agrees(identifier, 0x181, 0x80000181)
    assert not agrees(identifier, 0x181, 0x182)
    assert not agrees(objects.LIMIT_HIGH, 121_000, 121_001)
    assert agrees(objects.LIMIT_LOW, -1000, -1000)


def test_values_are_packed_by_the_objects_type() -> None:
    assert objects.TARGET.pack(-2) == bytes.fromhex("FE FF FF FF")
    assert objects.MODE.pack(-1) == b"\xff"
    assert objects.STATUSWORD.unpack(bytes.fromhex("37 02")) == 0x237
    assert objects.STATUSWORD.unpack(bytes(4)) is None
    with pytest.raises(ValueError, match=r"object 6040:00 \(controlword\): 65536 does not fit"):
        objects.CONTROLWORD.pack(65536)


def test_defaults_are_within_their_own_range_and_fit_their_type() -> None:
    for entry in objects.OBJECTS.values():
        if isinstance(entry.default, int):
            entry.pack(entry.default)
            assert entry.low is None or entry.by_node or entry.low <= entry.default
            assert entry.high is None or entry.default <= entry.high


def test_default_pdos_are_the_makers() -> None:
    defaults = {key: entry.default for key, entry in objects.OBJECTS.items()}
    assert defaults[0x1402, 1] == 0x400
    assert [defaults[0x1602, sub] for sub in range(4)] == [2, 0x60400010, 0x607A0020, 0]
    assert defaults[0x1800, 1] == 0x40000180
    assert defaults[0x1801, 1] == 0xC0000280
    assert defaults[0x1A03, 2] == 0x606C0020
    assert defaults[0x1800, 3] == 10
    assert (0x1800, 4) not in objects.OBJECTS
    assert (0x1800, 5) not in objects.OBJECTS


def test_faults_are_told_in_words() -> None:
    assert describe(0x8611) == "0x8611 following error"
    assert describe(0x8130) == "0x8130 the host's heartbeat was missing"
    assert describe(0x9999) == "0x9999 an error its table does not name"
    assert {fault.reaction for fault in FAULTS.values()} == {"off", "abort connection", "fault reaction"}
