"""Firmata by literal bytes of its protocol document, in pieces, damaged, and at random."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.firmata.codec import (
    LONGEST,
    FirmataMessage,
    FirmataParser,
    PinReading,
    Protocol,
    Sysex,
    analog_channels,
    firmware_of,
    report,
    sampling_interval,
    sysex,
)
from drivers.roles import LinkCounters

# github.com/firmata/protocol: analogue input 2 reads 0x1A5 = 421; version 2.5; firmware "AB" 1.2.
READS_421 = bytes.fromhex("e2 25 03")
VERSION_2_5 = bytes.fromhex("f9 02 05")
FIRMWARE_AB = bytes.fromhex("f0 79 01 02 41 00 42 00 f7")
# Two pins without, two with analogue inputs 0 and 1.
MAPPING = bytes.fromhex("f0 6a 7f 7f 00 01 f7")
ALL = READS_421 + VERSION_2_5 + FIRMWARE_AB + MAPPING
MEANS: list[FirmataMessage] = [
    PinReading(2, 421),
    Protocol(2, 5),
    Sysex(0x79, bytes.fromhex("0102 4100 4200")),
    Sysex(0x6A, bytes.fromhex("7f7f 0001")),
]


def parsed(*pieces: bytes) -> tuple[list[FirmataMessage], LinkCounters]:
    counters = LinkCounters()
    parser = FirmataParser(counters)
    return [message for piece in pieces for message in parser.feed(piece)], counters


def test_each_message_of_the_document_means_what_it_says() -> None:
    assert parsed(ALL)[0] == MEANS
    assert firmware_of(bytes.fromhex("0102 4100 4200")) == ("AB", "1.2")
    assert firmware_of(b"") == ("", "")
    assert analog_channels(bytes.fromhex("7f7f 0001")) == {0, 1}


@given(st.integers(1, 9))
def test_pieces_of_any_size_make_the_same(size: int) -> None:
    found, counters = parsed(*(ALL[at : at + size] for at in range(0, len(ALL), size)))
    assert found == MEANS
    assert (counters.frames, counters.discarded_bytes) == (4, 0)


@pytest.mark.parametrize(
    ("damaged", "found", "discarded"),
    [
        (READS_421[:2] + READS_421, [PinReading(2, 421)], 2),  # a byte was lost: the next message begins
        (b"\x25\x03" + READS_421, [PinReading(2, 421)], 2),  # data without a head
        (FIRMWARE_AB[:-1] + READS_421, [PinReading(2, 421)], 8),  # a report without its end
        (b"\xf7" + READS_421, [PinReading(2, 421)], 1),  # an end without a beginning
        (b"\xf0\xf7" + READS_421, [PinReading(2, 421)], 2),  # an empty report
        (b"\x90\x01\x00" + READS_421, [PinReading(2, 421)], 0),  # digital ports are read, and not wanted
    ],
)
def test_what_is_damaged_is_counted_and_the_next_message_read(
    damaged: bytes, found: list[FirmataMessage], discarded: int
) -> None:
    messages, counters = parsed(damaged)
    assert [message for message in messages if message in MEANS] == found
    assert counters.discarded_bytes == discarded


@given(st.lists(st.binary(max_size=40)))
def test_random_bytes_never_crash_it_and_the_next_message_is_read(noise: list[bytes]) -> None:
    messages, _ = parsed(*noise, READS_421)
    assert messages[-1] == PinReading(2, 421)


def test_an_endless_report_is_not_kept() -> None:
    messages, counters = parsed(b"\xf0" + b"\x01" * (3 * LONGEST), READS_421)
    assert messages == [PinReading(2, 421)]
    assert counters.discarded_bytes >= 3 * LONGEST - 1


def test_what_is_asked_of_a_board() -> None:
    assert sysex(0x79) == bytes.fromhex("f0 79 f7")
    assert sampling_interval(200) == bytes.fromhex("f0 7a 48 01 f7")
    assert report(3, True) + report(3, False) == bytes.fromhex("c3 01 c3 00")
