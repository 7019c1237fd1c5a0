import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.framing import FrameDecoder
from drivers.robotiq.codec import (
    FRAME_BYTES,
    FRAME_NS,
    START_STREAM,
    STOP_BURST,
    STREAM_STARTED,
    Wrench,
    decode_firmware,
    decode_forces,
    decode_serial_number,
    encode_frame,
    encode_read,
    encode_write,
    is_intact,
    make_decoder,
    refusal,
    to_counts,
    with_crc,
)
from drivers.roles import LinkCounters
from tests.drivers.test_crc import bit_by_bit

RAW = bytes.fromhex(
    "204E"  # frame start
    "7D00 06FF F9FC"  # Fx 1.25, Fy -2.50, Fz -7.75 N
    "7D00 06FF F401"  # Mx 0.125, My -0.250, Mz 0.500 N m
    "255C"  # CRC-16/MODBUS of the 14 bytes before it, low byte first
)
WRENCH = Wrench(1.25, -2.5, -7.75, 0.125, -0.25, 0.5)
OTHER = Wrench(0.0, 0.01, 300.0, -30.0, 0.001, 0.0)

counts = st.lists(st.integers(-0x8000, 0x7FFF), min_size=6, max_size=6)


def decoder() -> tuple[FrameDecoder[Wrench], LinkCounters]:
    counters = LinkCounters()
    return make_decoder(counters), counters


def raw(wrench: Wrench) -> bytes:
    return encode_frame(to_counts(wrench))


@pytest.mark.parametrize(
    ("request_", "line"),
    [
        (encode_read(180, 1), "09 03 00 B4 00 01 C5 64"),
        (encode_read(180, 6), "09 03 00 B4 00 06 84 A6"),
        (encode_write(410, [0x0200]), "09 10 01 9A 00 01 02 02 00 CD CA"),
    ],
)
def test_requests_as_the_manual_prints_them(request_: bytes, line: str) -> None:
    assert request_ == bytes.fromhex(line)
    assert bytes.fromhex(line) == with_crc(bytes.fromhex(line)[:-2])


def test_the_stream_is_started_by_a_write_and_stopped_by_a_burst() -> None:
    assert encode_write(410, [0x0200]) == START_STREAM
    assert STREAM_STARTED[:6] == START_STREAM[:6]
    assert is_intact(STREAM_STARTED)
    assert STOP_BURST == b"\xff" * 50


def test_a_checksum_needs_a_message_in_front_of_it() -> None:
    assert not is_intact(b"")
    assert not is_intact(b"\xff\xff")
    assert not is_intact(bytes.fromhex("09 03 00 B4 00 01 C5 65"))


def test_a_written_out_frame_is_decoded_and_encoded() -> None:
    reader, counters = decoder()
    assert len(RAW) == FRAME_BYTES == 16
    assert bit_by_bit(RAW[:14], 0xFFFF) == 0x5C25
    assert reader.feed(RAW) == [WRENCH]
    assert raw(WRENCH) == RAW
    assert counters == LinkCounters(frames=1)


def test_a_frame_takes_8_333_ms_of_the_line() -> None:
    assert FRAME_NS == 8_333_333


@pytest.mark.parametrize("cut", range(FRAME_BYTES + 1))
def test_a_frame_may_be_split_at_every_byte(cut: int) -> None:
    reader, counters = decoder()
    assert reader.feed(RAW[:cut]) + reader.feed(RAW[cut:]) == [WRENCH]
    assert counters == LinkCounters(frames=1)


def test_a_frame_may_come_byte_by_byte() -> None:
    reader, _ = decoder()
    assert [wrench for byte in RAW + RAW for wrench in reader.feed(bytes([byte]))] == [WRENCH, WRENCH]


def test_garbage_between_frames_is_counted_and_passed_over() -> None:
    reader, counters = decoder()
    assert reader.feed(STREAM_STARTED + RAW + b"\xff\xff\x20" + raw(OTHER)) == [WRENCH, OTHER]
    assert counters == LinkCounters(frames=2, discarded_bytes=8 + 3)


def test_a_wrong_checksum_costs_that_frame_only() -> None:
    reader, counters = decoder()
    assert reader.feed(RAW + RAW[:-1] + b"\x00" + raw(OTHER)) == [WRENCH, OTHER]
    assert counters == LinkCounters(frames=2, checksum_errors=1, discarded_bytes=FRAME_BYTES)


def test_frame_starts_inside_the_data_do_not_mislead() -> None:
    spoof = encode_frame([0x4E20] * 6)
    assert spoof.count(b"\x20\x4e") == 7
    reader, counters = decoder()
    assert reader.feed(spoof[2:] + spoof + spoof) == [Wrench(200.0, 200.0, 200.0, 20.0, 20.0, 20.0)] * 2
    assert counters == LinkCounters(frames=2, discarded_bytes=FRAME_BYTES - 2)


@pytest.mark.parametrize("junk", [b"\x20", b"\x20\x4e", b"\xff", b"\x4e\x20\x4e"])
def test_overlong_input_leaves_less_than_a_frame_behind(junk: bytes) -> None:
    reader, counters = decoder()
    for _ in range(20):
        assert reader.feed(junk * 200) == []
        assert reader.held < FRAME_BYTES
    assert counters.discarded_bytes + reader.held == 20 * 200 * len(junk)


@given(counts)
def test_every_frame_survives_the_wire(values: list[int]) -> None:
    reader, _ = decoder()
    (wrench,) = reader.feed(encode_frame(values))
    assert to_counts(wrench) == values


@given(st.lists(st.binary(max_size=200), max_size=20))
def test_no_input_raises_or_is_held_or_goes_uncounted(chunks: list[bytes]) -> None:
    reader, counters = decoder()
    for chunk in chunks:
        reader.feed(chunk)
        assert reader.held < FRAME_BYTES
    assert counters.frames * FRAME_BYTES + counters.discarded_bytes + reader.held == sum(map(len, chunks))


@given(st.lists(st.one_of(counts, st.binary(max_size=40)), max_size=12), st.integers(1, 40))
def test_frames_between_any_garbage_are_all_recovered(parts: list[list[int] | bytes], chunk: int) -> None:
    stream = b"".join(part if isinstance(part, bytes) else encode_frame(part) for part in parts)
    expected = [part for part in parts if not isinstance(part, bytes)]
    assume(sum(_looks_like_a_frame(stream, at) for at in range(len(stream))) == len(expected))
    reader, _ = decoder()
    found = [wrench for at in range(0, len(stream), chunk) for wrench in reader.feed(stream[at : at + chunk])]
    assert [to_counts(wrench) for wrench in found] == expected


def _looks_like_a_frame(stream: bytes, at: int) -> bool:
    window = stream[at : at + FRAME_BYTES]
    intact = bit_by_bit(window[:14], 0xFFFF).to_bytes(2, "little") == window[14:]
    return len(window) == FRAME_BYTES and window[:2] == b"\x20\x4e" and intact


def test_registers_hold_twos_complement_counts() -> None:
    assert decode_forces([125, 0xFF06, 0xFCF9, 125, 0xFF06, 500]) == WRENCH


def test_firmware_is_three_letters_and_three_numbers() -> None:
    assert decode_firmware([0x4654, 0x5302, 0x0004]) == "FTS-2.0.4"


def test_the_serial_number_has_its_low_word_first() -> None:
    assert decode_serial_number([0x4654, 0x5300, 1234, 0]) == "FTS-1234"
    assert decode_serial_number([0x4654, 0x5300, 0, 1234]) == "FTS-80871424"


def test_the_converter_stops_at_its_ends() -> None:
    assert to_counts([400.0, -400.0, 0.0, 40.0, -40.0, 0.0]) == [32767, -32768, 0, 32767, -32768, 0]


@pytest.mark.parametrize(
    ("wrench", "in_range"),
    [
        (Wrench(300.0, -300.0, 0.0, 30.0, -30.0, 0.0), True),
        (Wrench(0.0, 0.0, 300.01, 0.0, 0.0, 0.0), False),
        (Wrench(0.0, -300.01, 0.0, 0.0, 0.0, 0.0), False),
        (Wrench(0.0, 0.0, 0.0, 0.0, 30.001, 0.0), False),
    ],
)
def test_the_range_is_300_newtons_and_30_newton_metres(wrench: Wrench, in_range: bool) -> None:
    assert wrench.in_range is in_range


def test_a_refusal_is_found_among_other_bytes() -> None:
    exception = with_crc(b"\x09\x90\x03")
    assert refusal(b"\x09\x90\x00" + exception + RAW) == 3
    assert refusal(exception[:-1]) is None
    assert refusal(exception[:-1] + b"\x00") is None
    assert refusal(STREAM_STARTED + RAW) is None
