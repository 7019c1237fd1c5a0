import struct

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.bota.codec import (
    COMMAND_BYTES_MAX,
    CONFIG_MODE,
    FRAME_BYTES,
    HARD_RESET,
    RUN_MODE,
    SOFT_RESET,
    Ack,
    BootText,
    ForceFrame,
    encode_communication,
    encode_filter,
    encode_frame,
    find_ack,
    find_boot_text,
    line_rate_Hz,
    make_decoder,
    rate_Hz,
    sinc_for,
)
from drivers.framing import FrameDecoder
from drivers.roles import LinkCounters
from rig.errors import UsageError
from tests.drivers.test_crc import makers_x25

RAW = bytes.fromhex(
    "AA"  # header
    "0200"  # status: overrange
    "0000C03F 000010C0 000040C0"  # Fx 1.5, Fy -2.25, Fz -3.0 N
    "0000003E 000080BE 0000003F"  # Mx 0.125, My -0.25, Mz 0.5 N m
    "40E20100"  # 123456 us
    "0000C841"  # 25.0 degC
    "187B"  # CRC-16/X-25 of the 34 bytes behind the header
)
FRAME = ForceFrame(2, 1.5, -2.25, -3.0, 0.125, -0.25, 0.5, 123456, 25.0)
OTHER = ForceFrame(0, 0.5, 0.25, -8.0, 0.0, 0.0, 1.0, 124452, 25.0)

floats = st.floats(width=32, allow_nan=False)
frames = st.builds(
    ForceFrame, st.integers(0, 0xFFFF), *[floats] * 6, st.integers(0, 0xFFFF_FFFF), floats
)  # fmt: skip


def decoder() -> tuple[FrameDecoder[ForceFrame], LinkCounters]:
    counters = LinkCounters()
    return make_decoder(counters), counters


def test_commands_are_bare_ascii_without_a_terminator() -> None:
    assert (CONFIG_MODE, RUN_MODE, SOFT_RESET, HARD_RESET) == (b"C", b"R", b"I", b"#")
    assert encode_communication(temperature_compensation=False, calibrated=True, baud=460_800) == b"c,0,1,0,4"
    assert encode_communication(temperature_compensation=True, calibrated=False, baud=9_600) == b"c,1,0,0,0"
    assert encode_filter(512) == b"f,512,0,0,1"
    assert encode_filter(51, chop=True, fast=True, fir_disabled=False) == b"f,51,1,1,0"
    assert len(encode_filter(512)) <= COMMAND_BYTES_MAX


def test_a_written_out_frame_is_decoded_and_encoded() -> None:
    reader, counters = decoder()
    assert len(RAW) == FRAME_BYTES == 37
    assert makers_x25(RAW[1:35]) == 0x7B18
    assert reader.feed(RAW) == [FRAME]
    assert encode_frame(FRAME) == RAW
    assert counters == LinkCounters(frames=1)


@pytest.mark.parametrize("cut", range(FRAME_BYTES + 1))
def test_a_frame_may_be_split_at_every_byte(cut: int) -> None:
    reader, counters = decoder()
    assert reader.feed(RAW[:cut]) + reader.feed(RAW[cut:]) == [FRAME]
    assert counters == LinkCounters(frames=1)


def test_a_frame_may_come_byte_by_byte() -> None:
    reader, _ = decoder()
    assert [frame for byte in RAW + RAW for frame in reader.feed(bytes([byte]))] == [FRAME, FRAME]


def test_garbage_between_frames_is_counted_and_passed_over() -> None:
    reader, counters = decoder()
    assert reader.feed(b"r,0,R,0\r\n" + RAW + b"\x00\xff noise" + encode_frame(OTHER)) == [FRAME, OTHER]
    assert counters == LinkCounters(frames=2, discarded_bytes=9 + 8)


def test_a_wrong_checksum_costs_that_frame_only() -> None:
    reader, counters = decoder()
    wrong = RAW[:-1] + b"\x00"
    assert reader.feed(RAW + wrong + wrong + encode_frame(OTHER)) == [FRAME, OTHER]
    assert counters == LinkCounters(frames=2, checksum_errors=2, discarded_bytes=2 * FRAME_BYTES)


def test_a_frame_cut_short_costs_that_frame_only() -> None:
    reader, counters = decoder()
    assert reader.feed(RAW + RAW[:20] + encode_frame(OTHER)) == [FRAME, OTHER]
    assert counters == LinkCounters(frames=2, checksum_errors=1, discarded_bytes=20)


def test_header_bytes_inside_the_data_do_not_mislead() -> None:
    (aa,) = struct.unpack("<f", b"\xaa" * 4)
    frame = ForceFrame(0xAAAA, aa, aa, aa, aa, aa, aa, 0xAAAA_AAAA, aa)
    raw = encode_frame(frame)
    assert raw.count(b"\xaa") >= 35
    reader, counters = decoder()
    assert reader.feed(raw[11:] + raw + raw) == [frame, frame]
    assert counters == LinkCounters(frames=2, discarded_bytes=FRAME_BYTES - 11)


def test_a_header_just_before_a_frame_does_not_delay_it() -> None:
    reader, counters = decoder()
    assert reader.feed(b"\xaa\x01" + RAW) == [FRAME]
    assert counters == LinkCounters(frames=1, discarded_bytes=2)


@pytest.mark.parametrize("junk", [b"\xaa", b"\x00", b"\xaa\x00\xff", b"App Init\r\n"])
def test_overlong_input_leaves_less_than_a_frame_behind(junk: bytes) -> None:
    reader, counters = decoder()
    for _ in range(20):
        assert reader.feed(junk * 200) == []
        assert reader.held < FRAME_BYTES
    assert counters.discarded_bytes + reader.held == 20 * 200 * len(junk)


@given(frames)
def test_every_frame_survives_the_wire(frame: ForceFrame) -> None:
    reader, _ = decoder()
    assert reader.feed(encode_frame(frame)) == [frame]


@given(st.lists(st.binary(max_size=200), max_size=20))
def test_no_input_raises_or_is_held_or_goes_uncounted(chunks: list[bytes]) -> None:
    reader, counters = decoder()
    for chunk in chunks:
        reader.feed(chunk)
        assert reader.held < FRAME_BYTES
    assert counters.frames * FRAME_BYTES + counters.discarded_bytes + reader.held == sum(map(len, chunks))


@given(st.lists(st.one_of(frames, st.binary(max_size=60)), max_size=12), st.integers(1, 80))
def test_frames_between_any_garbage_are_all_recovered(parts: list[ForceFrame | bytes], chunk: int) -> None:
    stream = b"".join(encode_frame(part) if isinstance(part, ForceFrame) else part for part in parts)
    expected = [part for part in parts if isinstance(part, ForceFrame)]
    assume(sum(_looks_like_a_frame(stream, at) for at in range(len(stream))) == len(expected))
    reader, counters = decoder()
    found = [frame for at in range(0, len(stream), chunk) for frame in reader.feed(stream[at : at + chunk])]
    assert found == expected
    assert counters.frames == len(expected)


def _looks_like_a_frame(stream: bytes, at: int) -> bool:
    window = stream[at : at + FRAME_BYTES]
    intact = makers_x25(window[1:35]).to_bytes(2, "little") == window[35:]
    return len(window) == FRAME_BYTES and window[:1] == b"\xaa" and intact


def test_answers_are_found_by_the_letter_of_their_command() -> None:
    assert find_ack(b"r,0,C,0", b"C") == Ack(0, 7)
    assert find_ack(b"\xaa\x00r,0,C,0\r\nr,0,f,1\r\n", b"f,51,0,0,1") == Ack(1, 18)
    assert find_ack(b"r,0,C,0\r\n", b"c,0,1,0,4") is None
    assert find_ack(b"r,0,C,", b"C") is None


BOOT = b"c,0,1,0,4\r\nApp Init\r\nname: BFT-SENS-SER-M8\r\nS/N: 000271\r\nFW version: 1.0.6\r\n"


def test_boot_text_tells_name_serial_number_and_firmware() -> None:
    assert find_boot_text(RAW + BOOT) == BootText("BFT-SENS-SER-M8", "000271", "1.0.6")


@pytest.mark.parametrize("cut", range(len(BOOT) - 1))
def test_boot_text_is_not_read_before_it_is_all_there(cut: int) -> None:
    assert find_boot_text(BOOT[:cut]) is None


def test_boot_text_with_bytes_that_are_no_text_is_still_read() -> None:
    assert find_boot_text(b"name: \xff\r\nS/N: 1\r\nFW version: 2\r\n") == BootText("\ufffd", "1", "2")


@pytest.mark.parametrize(
    ("wanted_Hz", "sinc", "given_Hz"),
    [(1000, 51, 1003.9), (1004, 51, 1003.9), (800, 64, 800), (400, 128, 400), (250, 205, 249.8), (200, 256, 200),
     (100, 512, 100)],
)  # fmt: skip
def test_rates_come_from_the_length_of_the_sinc_filter(wanted_Hz: float, sinc: int, given_Hz: float) -> None:
    assert sinc_for(wanted_Hz) == sinc
    assert rate_Hz(sinc) == pytest.approx(given_Hz, abs=0.05)


@pytest.mark.parametrize("wanted_Hz", [10, 98.9, 500, 790, 990])
def test_a_rate_more_than_one_percent_off_is_refused_with_those_there_are(wanted_Hz: float) -> None:
    with pytest.raises(UsageError, match="1004, 800, 400, 250, 200, 100 Hz"):
        sinc_for(wanted_Hz)


def test_the_line_carries_the_highest_rate_at_its_default_baud_only() -> None:
    assert line_rate_Hz(460_800) == pytest.approx(1245.4, abs=0.1)
    assert line_rate_Hz(230_400) < rate_Hz(51)
