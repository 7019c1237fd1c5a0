"""Zaber's ASCII lines: vectors of the manual and of zaber-motion's own traffic, and lines that are none."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.roles import LinkCounters
from drivers.zaber import flags
from drivers.zaber.codec import LONGEST, LineDecoder, Scale, ZaberReply, encode_command, encode_reply


def fed(data: bytes, size: int = 1 << 16, demanding: bool = False) -> tuple[list[ZaberReply], LinkCounters]:
    counters = LinkCounters()
    decoder = LineDecoder(counters)
    decoder.demanding = demanding
    pieces = [data[at : at + size] for at in range(0, len(data), size)]
    return [reply for piece in pieces for reply in decoder.feed(piece)], counters


@pytest.mark.parametrize(
    ("number", "command", "wire"),
    [  # captured from zaber-motion 10.2
        (7, "move abs 50000", b"/1 1 07 move abs 50000:B5\n"),
        (0, "move abs 1000 500 20", b"/1 1 00 move abs 1000 500 20:B9\n"),
        (8, "", b"/1 1 08:F6\n"),
        (5, "home", b"/1 1 05 home:30\n"),
        (11, "get pos", b"/1 1 11 get pos:2A\n"),
        (13, "warnings clear", b"/1 1 13 warnings clear:4A\n"),
        (14, "driver disable", b"/1 1 14 driver disable:59\n"),
    ],
)
def test_commands_are_those_of_the_makers_own_library(number: int, command: str, wire: bytes) -> None:
    assert encode_command(1, 1, number, command) == wire


@pytest.mark.parametrize("size", [1, 5, 1000])
def test_a_reply_says_who_state_flag_and_data(size: int) -> None:
    wire = b"@01 1 07 OK BUSY WR 0\r\n@01 1 OK IDLE -- 123456\r\n@02 0 08 RJ IDLE FS BADDATA\n"
    assert fed(wire, size)[0] == [
        ZaberReply("@", 1, 1, 7, True, True, "WR", "0"),
        ZaberReply("@", 1, 1, None, True, False, "--", "123456"),
        ZaberReply("@", 2, 0, 8, False, False, "FS", "BADDATA"),
    ]


def test_notes_and_alerts_are_told_apart_from_replies() -> None:
    assert fed(b"!01 1 IDLE --\r\n#01 1 07 further text\r\n")[0] == [
        ZaberReply("!", 1, 1, None, True, False, "--", ""),
        ZaberReply("#", 1, 1, 7, True, False, "--", "further text"),
    ]


def test_a_checksum_is_checked_and_a_wrong_one_counted() -> None:
    """By hand: 48+49+32+48+32+79+75+32+73+68+76+69+32+87+82+32+48 = 962, and -962 modulo 256 is 0x3E."""
    good = b"@01 0 OK IDLE WR 0:3E\r\n"
    replies, counters = fed(b"garbage" + good.replace(b"3E", b"3F") + good)
    assert (len(replies), counters.checksum_errors, counters.frames) == (1, 1, 1)


def test_where_checksums_are_demanded_a_line_without_one_is_damaged() -> None:
    replies, counters = fed(b"@01 1 07 OK BUSY -- 12\r\n", demanding=True)
    assert (replies, counters.checksum_errors) == ([], 1)


@pytest.mark.parametrize(
    "line",
    [
        b"@1 1 OK IDLE -- 0",
        b"@01 1 07 XX IDLE -- 0",
        b"@01 1 07 OK AWAKE -- 0",
        b"!01 1 07 OK IDLE --",
        b"01 1 07 OK",
        b"@01 1 07 OK IDLE -- \xde",
        b"#01 1 \xb4",
    ],
)
def test_what_is_no_reply_is_discarded(line: bytes) -> None:
    replies, counters = fed(line + b"\r\n")
    assert (replies, counters.discarded_bytes) == ([], len(line))


replies = st.builds(
    ZaberReply,
    st.just("@"),
    st.integers(0, 99),
    st.integers(0, 9),
    st.none() | st.integers(0, 99),
    st.booleans(),
    st.booleans(),
    st.sampled_from(["--", *flags.FLAGS]),
    st.text("abc 0123456789-.", max_size=40).map(str.strip),
)


@given(st.lists(replies, max_size=5), st.integers(1, 30))
def test_what_was_packed_is_read_in_any_pieces(sent: list[ZaberReply], size: int) -> None:
    assert fed(b"".join(map(encode_reply, sent)), size, demanding=True)[0] == sent


@given(st.lists(st.binary(max_size=300) | st.sampled_from([b"@01 1 07 OK BUSY WR 0:8F\r\n", b"@01 1"]), max_size=8))
def test_whatever_comes_it_holds_less_than_a_line(pieces: list[bytes]) -> None:
    decoder = LineDecoder(LinkCounters())
    for piece in pieces:
        decoder.feed(piece)
        assert decoder.held <= LONGEST


def test_units_are_those_of_the_manual() -> None:
    """A microstep of 0.047625 um: 26,000 um/s are 545,931.8 microsteps/s, times 1.6384 are 894,455."""
    scale = Scale(1000 / 0.047625, 1)
    assert scale.speed(26.0) == 894_455
    assert scale.acceleration(1000.0) == 3440  # 20,997,375 microsteps/s2 x 1.6384 / 10,000
    assert scale.steps(1.0) == 20_997
    assert scale.mm(20_997) == pytest.approx(1.0, abs=1e-4)
    assert Scale(100.0, -1).steps(2.5) == -250 and Scale(100.0, -1).mm(-250) == 2.5


def test_no_speed_is_ever_0_which_would_mean_the_greatest() -> None:
    assert (Scale(100.0, 1).speed(0.0), Scale(100.0, 1).acceleration(0.0)) == (1, 1)


def test_flags_and_reasons_are_told_in_words() -> None:
    assert flags.described("FS") == "FS: stalled and stopped" and flags.described("--") == ""
    assert flags.described("F9") == "F9: a flag that is not in the manual"
    assert flags.reason("BADDATA") == "BADDATA: a value is out of its range"
    assert flags.is_fault("FV") and not flags.is_fault("WR") and not flags.is_fault("--")
