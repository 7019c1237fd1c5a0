"""OpenIGTLink messages: layouts that pyigtl packed, checksums that crcmod computed, and bytes that are none."""

import struct

import crcmod
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.openigtlink import codec
from drivers.openigtlink.codec import MessageDecoder, TimedMessage, crc64, tools_in
from drivers.poses import ToolPose
from drivers.roles import LinkCounters

MATRIX = bytes.fromhex(
    "000000003f80000000000000bf800000000000000000000000000000000000003f80000041440000c20a0000c47a0000"
)
# pyigtl 0.3.1: a quarter turn about z at (12.25, -34.5, -1000) mm, half a second past 1,700,000,000 s.
PLAIN = (
    bytes.fromhex(
        "00015452414e53464f524d00000074697000000000000000000000000000000000006553f100800000000000000000000030"
    )
    + bytes.fromhex("0bd8f2e4f67f4529")
    + MATRIX
)
# The same with message id 7 and the metadata {"status": "OK"}.
EXTENDED = (
    bytes.fromhex(
        "00025452414e53464f524d00000074697000000000000000000000000000000000006553f10080000000000000000000004e"
    )
    + bytes.fromhex("6278bdbd1d3935ad000c000a0000000800000007")
    + MATRIX
    + bytes.fromhex("000100060003000000027374617475734f4b")
)
SENT_NS = 1_700_000_000_500_000_000
HALF = 0.5**0.5


def fed(data: bytes, size: int = 1 << 20) -> tuple[list[TimedMessage], LinkCounters, int]:
    counters = LinkCounters()
    decoder = MessageDecoder(counters)
    found = [message for at in range(0, len(data), size) for message in decoder.feed(data[at : at + size])]
    return found, counters, decoder.held


def test_the_checksum_has_the_check_value_of_its_catalogue() -> None:
    assert crc64(b"123456789") == 0x6C40DF5F0B497347


@given(st.binary(max_size=300))
def test_the_checksum_is_that_of_another_implementation(data: bytes) -> None:
    assert crc64(data) == crcmod.mkCrcFun(0x142F0E1EBA9EA3693, rev=False, initCrc=0, xorOut=0)(data)


@pytest.mark.parametrize("size", [1, 7, 57, 58, 1000])
@pytest.mark.parametrize(("wire", "version"), [(PLAIN, 1), (EXTENDED, 2)])
def test_a_message_is_read_in_pieces_of_any_size(wire: bytes, version: int, size: int) -> None:
    assert fed(wire * 2, size)[0] == [TimedMessage("TRANSFORM", "tip", SENT_NS, version, MATRIX)] * 2


def test_both_header_versions_are_packed_as_pyigtl_packs_them() -> None:
    assert codec.encode("TRANSFORM", "tip", MATRIX, SENT_NS) == PLAIN
    bare = codec.encode("TRANSFORM", "tip", MATRIX, SENT_NS, codec.WITH_EXTENDED, 7)
    assert bare[58:70] == bytes.fromhex("000c0002 00000000 00000007")
    assert fed(bare)[0] == [TimedMessage("TRANSFORM", "tip", SENT_NS, 2, MATRIX)]


def test_the_columns_of_the_matrix_are_a_quarter_turn_about_z() -> None:
    (message,) = fed(PLAIN)[0]
    pose = tools_in(message)["tip"]
    assert pose is not None
    assert pose[:7] == pytest.approx((12.25, -34.5, -1000.0, HALF, 0.0, 0.0, HALF))
    assert struct.unpack(">12f", codec.encode_transform(pose)) == pytest.approx(struct.unpack(">12f", MATRIX), abs=1e-6)


def test_tracking_data_hold_each_tool_by_name() -> None:
    """Layout by hand after v2_trackingdata: name 20, type, reserved, twelve reals."""
    content = b"tip".ljust(20, b"\0") + b"\x02\0" + MATRIX + b"arm".ljust(20, b"\0") + b"\x03\0" + MATRIX
    tools = tools_in(TimedMessage("TDATA", "Tracker", 0, 1, content))
    assert list(tools) == ["tip", "arm"]
    pose = tools["tip"]
    assert pose and tools["arm"] == pose
    assert codec.encode_tools([("tip", pose)])[:22] == content[:22]
    assert tools_in(TimedMessage("TDATA", "Tracker", 0, 1, content[:-1])) == {}


@pytest.mark.parametrize(
    "matrix",
    [
        (0.0,) * 12,
        (1.0, 0, 0, 0, 1, 0, 0, 0, -1, 1, 2, 3),  # a mirror
        (2.0, 0, 0, 0, 2, 0, 0, 0, 2, 1, 2, 3),
        (float("nan"), 0, 0, 0, 1, 0, 0, 0, 1, 1, 2, 3),
    ],
    ids=["zeros", "mirror", "scaled", "no number"],
)
def test_what_is_no_rotation_is_no_pose(matrix: tuple[float, ...]) -> None:
    message = TimedMessage("TRANSFORM", "tip", 0, 1, struct.pack(">12f", *matrix))
    assert tools_in(message) == {"tip": None}


def test_the_order_to_start_is_36_bytes() -> None:
    assert codec.encode_start(16) == b"\0\0\0\x10" + bytes(32)
    assert codec.decode_resolution_ms(b"\0\0\0\x10" + bytes(32)) == 16
    assert codec.decode_resolution_ms(b"\0\0\0\x10") is None


def test_a_damaged_message_is_counted_and_the_next_one_read() -> None:
    damaged = PLAIN[:80] + bytes([PLAIN[80] ^ 1]) + PLAIN[81:]
    messages, counters, held = fed(b"noise" + damaged + PLAIN, 11)
    assert (len(messages), counters.checksum_errors, held) == (1, 1, 0)
    assert counters.discarded_bytes == len(b"noise" + damaged)


def test_a_damaged_length_loses_no_later_message() -> None:
    longer = PLAIN[:48] + b"\0\x60" + PLAIN[50:]  # its body would reach into the message behind it
    assert len(fed(longer + PLAIN)[0]) == 1


def test_a_header_torn_within_its_length_swallows_nothing() -> None:
    messages, counters, _ = fed(PLAIN[:46] + 3 * PLAIN)  # with what follows: a TRANSFORM of 0x15452 bytes
    assert (len(messages), counters.discarded_bytes) == (3, 46)


def test_a_large_body_is_passed_over_without_being_kept() -> None:
    image = struct.pack(">H12s20sIIQQ", 1, b"IMAGE", b"camera", 0, 0, 1_000_000, 0)
    decoder = MessageDecoder(LinkCounters())
    assert decoder.feed(image) == []
    for _ in range(10):
        assert decoder.feed(bytes(100_000)) == []
        assert decoder.held == 0
    assert len(decoder.feed(PLAIN)) == 1


def test_an_extended_header_that_does_not_fit_is_no_message() -> None:
    body = struct.pack(">HHII", 12, 0, 1000, 0) + MATRIX
    header = struct.pack(">H12s20sIIQQ", 2, b"TRANSFORM", b"tip", 0, 0, len(body), crc64(body))
    assert fed(header + body)[0] == []


@given(st.lists(st.one_of(st.binary(max_size=200), st.sampled_from([PLAIN, EXTENDED])), max_size=8))
def test_whatever_comes_it_holds_less_than_one_message(pieces: list[bytes]) -> None:
    decoder = MessageDecoder(LinkCounters())
    for piece in pieces:
        for message in decoder.feed(piece):
            tools_in(message)
        assert decoder.held < codec.LARGEST_BODY + 58


@given(st.integers(0, len(PLAIN) * 8 - 1))
def test_one_wrong_bit_never_gives_another_pose(bit: int) -> None:
    """Of the header, neither time nor name is protected by the checksum: the standard has it over the body alone."""
    wire = bytearray(PLAIN)
    wire[bit // 8] ^= 1 << bit % 8
    for message in fed(bytes(wire))[0]:
        assert message.content == MATRIX


def test_a_pose_turns_into_its_matrix_and_back_whichever_component_is_largest() -> None:
    for turn in ((1.0, 0, 0, 0), (0.1, 0.7, 0.5, 0.5), (0, 0.1, 0.99, 0), (-0.5, 0.5, -0.5, 0.5), (0.1, 0, 0, -0.99)):
        length = sum(part * part for part in turn) ** 0.5
        unit = [part / length for part in turn]
        pose = ToolPose(1, 2, 3, unit[0], unit[1], unit[2], unit[3], 0.0)
        back = tools_in(TimedMessage("TRANSFORM", "tip", 0, 1, codec.encode_transform(pose)))["tip"]
        assert back is not None
        same = sum(a * b for a, b in zip(back[3:7], unit, strict=True))
        assert abs(same) == pytest.approx(1.0, abs=1e-6)
