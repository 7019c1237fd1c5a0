"""NatNet datagrams by hand, and datagrams that are none: cut short, with counts that cannot be, of other versions."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.optitrack import packets
from drivers.optitrack.frames import MotiveFrame, decode_frame
from drivers.optitrack.models import decode_models
from drivers.optitrack.packets import BadPacket, Cursor
from mock_devices.interfaces import MarkerPose
from mock_devices.optitrack.packets import frame as packed
from mock_devices.optitrack.packets import models, server_information

BODY = struct.pack("<i3f4ffh", 7, 0.5, -0.25, 1.0, 0.0, 0.0, 0.0, 1.0, 0.002, 1)
HIDDEN = BODY[:-2] + b"\0\0"
MARKER = struct.pack("<i3ffhf", 7 << 16 | 2, 0.125, 0.0, 0.0, 0.01, 0x0A, 0.001)
OCCLUDED = MARKER[:20] + b"\x0b\0" + MARKER[22:]
NONE = struct.pack("<i", 0)
SUFFIX = struct.pack("<IIdQQQhi", 0, 0, 2.5, 1000, 1001, 1002, 0, 0)
POSE = MarkerPose(12.25, -34.5, -1000.0, 0.5, -0.5, 0.5, -0.5, 0.125)
versions = pytest.mark.parametrize("version", [(3, 0), (3, 1), (4, 0), (4, 1)])


def by_hand(bodies: bytes, markers: bytes) -> bytes:
    """A frame of NatNet 3 with one marker set of one marker, one other marker, no skeleton."""
    sets = struct.pack("<i", 1) + b"set\0" + struct.pack("<i3f", 1, 0.1, 0.2, 0.3)
    others = struct.pack("<i3f", 1, 0.4, 0.5, 0.6)
    count = [struct.pack("<i", len(part) // size) for part, size in ((bodies, 38), (markers, 26))]
    return struct.pack("<i", 99) + sets + others + count[0] + bodies + NONE + count[1] + markers + NONE * 2 + SUFFIX


def test_places_come_in_metres_and_leave_in_millimetres() -> None:
    found = decode_frame(by_hand(BODY, MARKER), (3, 0))
    assert (found.number, found.timestamp_s, found.ticks) == (99, 2.5, 1000)
    assert found.bodies[7] == pytest.approx((500.0, -250.0, 1000.0, 1.0, 0.0, 0.0, 0.0, 2.0))
    assert found.markers[7, 2][:3] == pytest.approx((125.0, 0.0, 0.0))
    assert math.isnan(found.markers[7, 2].q0) and found.markers[7, 2].error_mm == pytest.approx(1.0)


def test_what_is_not_tracked_or_occluded_is_not_there() -> None:
    found = decode_frame(by_hand(HIDDEN, OCCLUDED), (3, 0))
    assert (found.bodies, found.markers) == ({}, {})


@versions
def test_a_frame_of_each_version_is_read(version: tuple[int, int]) -> None:
    found = decode_frame(packed(5, [POSE, None], 12_345, version), version)
    assert (found.number, found.ticks, list(found.bodies)) == (5, 12_345, [1])
    assert found.bodies[1] == pytest.approx((*POSE[:3], 0.5, -0.5, 0.5, -0.5, 0.125))
    assert set(found.markers) == {(1, 1), (1, 2), (1, 3)}


@versions
def test_models_of_each_version_are_read(version: tuple[int, int]) -> None:
    assert decode_models(models(("tip", "arm"), version), version) == {"tip": 1, "arm": 2}


def test_a_frame_of_another_version_is_no_frame() -> None:
    with pytest.raises(BadPacket):
        decode_frame(packed(5, [POSE, POSE], 1, (4, 1)), (3, 0))


@versions
def test_every_shorter_frame_is_refused(version: tuple[int, int]) -> None:
    whole = packed(5, [POSE, None], 12_345, version)
    for size in range(len(whole) - 40):
        with pytest.raises(BadPacket):
            decode_frame(whole[:size], version)


def test_a_description_of_another_kind_ends_what_is_read_before_4_1_and_is_passed_over_from_then_on() -> None:
    """A force plate stands before a second body."""
    first, plate = models(("tip",), (4, 1)), struct.pack("<ii", 3, 6) + b"plate\0"
    many = struct.pack("<i", 7) + first[4:] + plate + first[4:]
    assert decode_models(many, (4, 1)) == {"tip": 1}
    old = models(("tip",), (3, 0))
    assert decode_models(struct.pack("<i", 4) + old[4:] + struct.pack("<i", 3) + b"plate", (3, 0)) == {"tip": 1}


def test_a_datagram_is_as_long_as_it_says() -> None:
    assert packets.split(b"\x04\x00\x00\x00") == (packets.REQUEST_MODELS, b"")
    assert packets.encode_packet(packets.KEEP_ALIVE) == b"\x0a\x00\x00\x00"
    for wrong in (b"\x04\x00\x01\x00", b"\x04\x00\x00\x00\x00", b"\x04\x00", b""):
        with pytest.raises(BadPacket):
            packets.split(wrong)


def test_connecting_names_us_and_our_version() -> None:
    """As long as what Motive's own client sends: 256 bytes of name, two versions."""
    wire = packets.encode_connect()
    assert (wire[:4], len(wire)) == (b"\0\0\x08\x01", 268)
    assert wire[4:15] == b"tissue-rig\0" and wire[-4:] == bytes((4, 1, 0, 0))


def test_a_server_says_how_its_clock_counts() -> None:
    server = packets.decode_server(server_information((4, 1), 1511))
    assert server == packets.ServerInfo("Motive", "3.1.0.1", (4, 1), 10_000_000)
    with pytest.raises(BadPacket):
        packets.decode_server(b"Motive")


def test_a_count_that_cannot_be_is_refused_at_once() -> None:
    for count in (-1, 1 << 30):
        with pytest.raises(BadPacket):
            Cursor(struct.pack("<i", count) + bytes(100)).count(4)
    with pytest.raises(BadPacket):
        Cursor(b"no end").text()


@given(st.binary(max_size=600) | st.binary(max_size=60).map(lambda tail: by_hand(BODY, MARKER)[:100] + tail))
def test_whatever_comes_it_is_a_frame_or_refused(payload: bytes) -> None:
    for version in ((3, 0), (4, 1)):
        for decode in (decode_frame, decode_models):
            try:
                found = decode(payload, version)
            except BadPacket:
                continue
            assert isinstance(found, MotiveFrame | dict)
