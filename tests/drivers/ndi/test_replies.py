"""What replies say, literally and there and back."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.ndi import replies
from drivers.ndi.replies import DISABLED, MISSING, STRAYS, TRANSFORMS, Pose, ToolReading, TrackingReply
from mock_devices.ndi.encoding import Scene, encode_bx, encode_tx
from tests.drivers.ndi.test_codec import BX_BODY, TX_REPLY

POSE = Pose(0.5, -0.5, 0.5, -0.5, 12.25, -34.5, -1000.0, 0.125)
THREE_TOOLS = TrackingReply(
    (
        ToolReading(1, POSE, port_status=0x31, frame=500),
        ToolReading(2, MISSING, port_status=0x31, frame=500),
        ToolReading(3, DISABLED),
    ),
    system_status=0x0080,
)
TX_TEXT = TX_REPLY[:-5].decode()


def test_tx_gives_poses_in_millimetres_and_tells_missing_from_disabled() -> None:
    assert replies.parse_tx(TX_TEXT) == THREE_TOOLS


def test_bx_gives_the_same_as_tx() -> None:
    assert replies.parse_bx(BX_BODY) == THREE_TOOLS


def test_a_disabled_tool_may_carry_status_and_frame_in_tx() -> None:
    assert replies.parse_tx("0103DISABLED00000000000001F4\n0000") == TrackingReply((ToolReading(3, DISABLED),), 0)


def test_an_unoccupied_port_counts_as_disabled() -> None:
    assert replies.parse_tx("0103UNOCCUPIED\n0000") == TrackingReply((ToolReading(3, DISABLED),), 0)


def test_without_tools_there_is_only_the_system_status() -> None:
    assert replies.parse_tx("000040") == TrackingReply((), 0x0040)
    assert replies.parse_bx(b"\0\x40\0") == TrackingReply((), 0x0040)


def test_stray_markers_are_passed_over() -> None:
    reply = TrackingReply((ToolReading(1, MISSING, 0x31, 500),), 0)
    two_strays = "02" + "0" + "+001000-002000-150000" * 2
    assert replies.parse_tx(f"0101MISSING00000031000001F4\n{two_strays}0000", TRANSFORMS | STRAYS) == reply
    body = bytes.fromhex("01 01 02 31000000 f4010000 02 00") + struct.pack("<6f", 1, 2, 3, 4, 5, 6) + b"\0\0"
    assert replies.parse_bx(body, TRANSFORMS | STRAYS) == reply


def test_what_other_options_add_to_a_tx_line_is_passed_over() -> None:
    reply = replies.parse_tx("0101MISSING00000031000001F40200000000000000000000\n0000", 0x0003)
    assert reply == TrackingReply((ToolReading(1, MISSING, 0x31, 500),), 0)


def test_a_reply_without_poses_cannot_be_asked_for() -> None:
    with pytest.raises(ValueError, match="TX:1000 asks for no poses"):
        replies.parse_tx("00", STRAYS)
    with pytest.raises(ValueError, match="BX:0009"):
        replies.parse_bx(b"", 0x0009)


@pytest.mark.parametrize("end", range(len(TX_TEXT)))
def test_a_tx_reply_cut_short_is_refused(end: int) -> None:
    assert replies.parse_tx(TX_TEXT[:end]) is None


@pytest.mark.parametrize("end", range(len(BX_BODY)))
def test_a_bx_reply_cut_short_is_refused(end: int) -> None:
    assert replies.parse_bx(BX_BODY[:end]) is None


@pytest.mark.parametrize(
    "text",
    [
        "0201MISSING00000031000001F4\n0000",  # one tool of two
        "0101MISSING00000031000001F4\n00000",  # a digit too many
        "0101MISSING00000031000001F4\n00G0",  # not a hexadecimal digit
        "0101+05000-05000+05000-05000+001225-003450-100000+0125\n0000",  # pose cut short
        "0101MISSING\n0000",  # no status and frame
        "OKAY",
    ],
)
def test_a_malformed_tx_reply_is_refused(text: str) -> None:
    assert replies.parse_tx(text) is None


def test_a_malformed_bx_reply_is_refused() -> None:
    assert replies.parse_bx(BX_BODY + b"\0") is None
    assert replies.parse_bx(b"\x01\x01\x03\x00\x00") is None


def test_a_pose_that_is_no_number_is_missing() -> None:
    body = b"\x01\x01\x01" + struct.pack("<8fII", *[math.nan] * 8, 0x31, 500) + b"\0\0"
    assert replies.parse_bx(body) == TrackingReply((ToolReading(1, MISSING, 0x31, 500),), 0)


def test_handles_come_with_their_port_status() -> None:
    assert replies.parse_handles("020100102031") == ((1, 0x001), (2, 0x031))
    assert replies.parse_handles("00") == ()
    assert replies.parse_handle("0A") == 10


@pytest.mark.parametrize("text", ["", "OKAY", "02010010203", "0G", "01"])
def test_a_malformed_list_of_handles_is_refused(text: str) -> None:
    assert replies.parse_handles(text) is None


@pytest.mark.parametrize("text", ["", "1", "0G", "010", "OKAY"])
def test_a_malformed_handle_is_refused(text: str) -> None:
    assert replies.parse_handle(text) is None


def test_version_gives_product_serial_number_and_freeze_tag() -> None:
    text = (
        "Polaris Vega Control Firmware\nNDI S/N: P9-00257\nCharacterization Date: 11/28/18\n"
        "Freeze Tag: Polaris Vega 024\nFreeze Date: 11/23/18\n(C) Northern Digital Inc.\n"
    )
    assert replies.parse_version(text) == ("Polaris Vega Control Firmware", "P9-00257", "Polaris Vega 024")


def test_another_makers_answer_is_no_version() -> None:
    assert replies.parse_version("V1013") is None


def test_information_gives_each_parameter_its_value() -> None:
    line = "Features.Firmware.Version=007.000.012;3;1;0;12;;Current firmware revision number"
    assert replies.parse_info(line) == {"Features.Firmware.Version": "007.000.012"}
    assert replies.parse_info("ERROR01") == {}


def test_errors_are_told_in_words() -> None:
    assert replies.parse_error("ERROR0C") == 0x0C
    assert replies.parse_error("OKAY") is None
    assert replies.error_words(0x0C) == "ERROR0C: command not allowed in the present mode"
    assert replies.error_words(0x99) == "ERROR99: not in the list of errors"


def test_a_warning_is_no_error() -> None:
    assert replies.is_warning("WARNING")
    assert replies.parse_error("WARNING") is None
    assert not replies.is_warning("OKAY")


def test_a_number_without_room_in_tx_is_the_callers_mistake() -> None:
    with pytest.raises(ValueError, match="does not fit"):
        encode_tx(Scene([ToolReading(1, POSE._replace(x_mm=10_000.0), 0, 0)]))


rotation = st.integers(-10000, 10000).map(lambda n: n / 10000)
millimetres = st.integers(-999999, 999999).map(lambda n: n / 100)
tx_poses = st.builds(Pose, *[rotation] * 4, *[millimetres] * 3, rotation)
singles = st.floats(width=32, allow_nan=False, allow_infinity=False)
bx_poses = st.builds(Pose, *[singles] * 8)


def tools(poses: st.SearchStrategy[Pose]) -> st.SearchStrategy[list[ToolReading]]:
    word = st.integers(0, 2**32 - 1)
    seen = st.builds(ToolReading, st.integers(0, 255), st.one_of(poses, st.just(MISSING)), word, word)
    return st.lists(st.one_of(seen, st.builds(ToolReading, st.integers(0, 255), st.just(DISABLED))), max_size=24)


@given(tools(tx_poses), st.integers(0, 0xFFFF), st.sampled_from([0x0001, 0x0801, 0x1001]))
def test_tx_there_and_back(readings: list[ToolReading], status: int, options: int) -> None:
    text = encode_tx(Scene(readings, system_status=status), options)
    assert replies.parse_tx(text, options) == TrackingReply(tuple(readings), status)


@given(tools(bx_poses), st.integers(0, 0xFFFF), st.sampled_from([0x0001, 0x0801, 0x1001]))
def test_bx_there_and_back(readings: list[ToolReading], status: int, options: int) -> None:
    body = encode_bx(Scene(readings, system_status=status), options)
    assert replies.parse_bx(body, options) == TrackingReply(tuple(readings), status)


@given(st.text(), st.binary(max_size=200), st.sampled_from([0x0001, 0x1001]))
def test_no_reply_makes_a_parser_raise(text: str, body: bytes, options: int) -> None:
    replies.parse_tx(text, options)
    replies.parse_bx(body, options)
    replies.parse_handles(text)
    replies.parse_handle(text)
    replies.parse_version(text)
    replies.parse_info(text)
    replies.parse_error(text)
