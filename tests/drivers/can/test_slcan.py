"""Lines of an SLCAN adapter: literal bytes of the CAN232 manual, damage, and round trips."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.slcan import LONGEST, CanFrame, SlcanDecoder, decode_line, encode_frame

VECTORS = {
    b"t0800\r": CanFrame(0x080),
    b"t0002017F\r": CanFrame(0x000, bytes((0x01, 0x7F))),
    b"t20160F00102700FF\r": CanFrame(0x201, bytes.fromhex("0F00102700FF")),
    b"t70117F\r": CanFrame(0x701, b"\x7f"),
    b"t60184018100100000000\r": CanFrame(0x601, bytes.fromhex("4018100100000000")),
    b"T1FFFFFFF0\r": CanFrame(0x1FFFFFFF, b"", extended=True),
    b"T0000010021122\r": CanFrame(0x100, b"\x11\x22", extended=True),
    b"r7010\r": CanFrame(0x701, b"", remote=True),
    b"R000007011\r": CanFrame(0x701, bytes(1), extended=True, remote=True),
}
STREAM = b"\r\rV1013\rt181637020A000000\rz\rt2818000000000000FFFF\r\at701105\rT000001002AABB\r"
FRAMES = [
    CanFrame(0x181, bytes.fromhex("37020A000000")),
    CanFrame(0x281, bytes.fromhex("000000000000FFFF")),
    CanFrame(0x701, b"\x05"),
    CanFrame(0x100, b"\xaa\xbb", extended=True),
]


@pytest.mark.parametrize(("line", "frame"), VECTORS.items())
def test_frames_and_lines_are_the_manuals(line: bytes, frame: CanFrame) -> None:
    assert encode_frame(frame) == line
    assert decode_line(line[:-1]) == frame


def test_lower_case_digits_and_a_time_stamp_are_understood() -> None:
    assert decode_line(b"t1812ab01") == CanFrame(0x181, b"\xab\x01")
    assert decode_line(b"t1812AB01EA5F") == CanFrame(0x181, b"\xab\x01")


@pytest.mark.parametrize(
    "line",
    [b"", b"t", b"t181", b"t1812AB", b"t1812AB012", b"t18190", b"t8000", b"tXYZ0", b"t181-", b"t1 10", b"t1_10",
     b"t1811G0", b"T200000000", b"x1810", b"z", b"t1812AB0G", b"t181 2AB01"],
)  # fmt: skip
def test_what_is_no_frame_is_none(line: bytes) -> None:
    assert decode_line(line) is None


@pytest.mark.parametrize(
    "frame", [CanFrame(0x800), CanFrame(-1), CanFrame(0x2000_0000, extended=True), CanFrame(1, bytes(9))]
)
def test_what_no_bus_can_carry_is_refused(frame: CanFrame) -> None:
    with pytest.raises(ValueError, match="not a classical CAN frame"):
        encode_frame(frame)


@given(
    can_id=st.integers(0, 0x7FF),
    data=st.binary(max_size=8),
    extended=st.booleans(),
)
def test_every_frame_survives_the_line(can_id: int, data: bytes, extended: bool) -> None:
    frame = CanFrame(can_id * (0x3FFFF if extended else 1), data, extended)
    assert decode_line(encode_frame(frame)[:-1]) == frame


@pytest.mark.parametrize("split", range(len(STREAM) + 1))
def test_a_stream_cut_at_any_byte_gives_the_same_frames_and_counts(split: int) -> None:
    decoder = SlcanDecoder()
    assert decoder.feed(STREAM[:split]) + decoder.feed(STREAM[split:]) == FRAMES
    assert (decoder.frames, decoder.acknowledged, decoder.refused) == (4, 3, 1)
    assert (decoder.malformed, decoder.discarded_bytes) == (0, 0)
    assert list(decoder.replies) == [b"V1013"]


def test_byte_by_byte_is_no_different() -> None:
    decoder = SlcanDecoder()
    assert [frame for byte in STREAM for frame in decoder.feed(bytes((byte,)))] == FRAMES


def test_garbage_between_frames_is_dropped_and_counted() -> None:
    decoder = SlcanDecoder()
    frames = decoder.feed(b"t70117F\r\x00\xffgarbage\rt1812AB\rt70105\rt701105\r")
    assert frames == [CanFrame(0x701, b"\x7f"), CanFrame(0x701, b"\x05")]
    assert decoder.malformed == 3
    assert decoder.discarded_bytes == len(b"\x00\xffgarbage" + b"t1812AB" + b"t70105")


def test_a_frame_that_lost_its_end_takes_no_other_with_it() -> None:
    decoder = SlcanDecoder()
    assert decoder.feed(b"t1816370\at701105\r") == [CanFrame(0x701, b"\x05")]
    assert decoder.malformed == 1
    assert decoder.refused == 0


def test_a_line_without_end_is_not_kept_and_the_next_frame_is_found() -> None:
    decoder = SlcanDecoder()
    for _ in range(1000):
        assert decoder.feed(b"7" * 50) == []
    assert decoder.feed(b"77\rt701105\r") == [CanFrame(0x701, b"\x05")]
    assert decoder.discarded_bytes == 50 * 1000 + 2
    assert decoder.malformed == 1


def test_a_line_one_too_long_is_refused_as_a_whole() -> None:
    decoder = SlcanDecoder()
    assert decoder.feed(b"t" + b"0" * LONGEST + b"\rt0800\r") == [CanFrame(0x080)]


@given(chunks=st.lists(st.binary(max_size=40)))
def test_no_bytes_raise_and_after_two_ends_of_line_it_is_in_step_again(chunks: list[bytes]) -> None:
    decoder = SlcanDecoder()
    for chunk in chunks:
        decoder.feed(chunk)
    assert decoder.feed(b"\r\rt0800\r")[-1:] == [CanFrame(0x080)]
    assert len(decoder.replies) <= 16


@pytest.mark.parametrize("split", range(20))
def test_line_feeds_behind_the_lines_are_passed_over(split: int) -> None:
    stream = b"\r\nV1013\r\nt701105\r\nz\r\n"
    decoder = SlcanDecoder()
    assert decoder.feed(stream[:split]) + decoder.feed(stream[split:]) == [CanFrame(0x701, b"\x05")]
    assert (decoder.acknowledged, decoder.malformed, list(decoder.replies)) == (2, 0, [b"V1013"])
