"""Modbus RTU of the load-cell transmitter: literal bytes of the standard, and bytes that are none."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.laumas.codec import LONGEST, AnswerDecoder, RegisterAnswer, ScaleWeights, decode_weights, encode_read
from drivers.roles import LinkCounters

# The Modbus specification's own example, slave 1: registers 107 to 109 hold 555, 0, 100 (checksum by `pymodbus`).
EXAMPLE = bytes.fromhex("01 03 06 02 2B 00 00 00 64 05 7A")
REFUSAL = bytes.fromhex("01 83 02 C0 F1")


def fed(data: bytes, size: int = 1 << 16) -> tuple[list[RegisterAnswer], LinkCounters]:
    counters = LinkCounters()
    decoder = AnswerDecoder(1, counters)
    return [one for at in range(0, len(data), size) for one in decoder.feed(data[at : at + size])], counters


def test_the_question_is_that_of_the_standard() -> None:
    assert encode_read(1, 107, 3) == bytes.fromhex("01 03 00 6B 00 03 74 17")
    assert encode_read(1, 6, 5) == bytes.fromhex("01 03 00 06 00 05 65 C8")


@pytest.mark.parametrize("size", [1, 4, 100])
def test_answers_are_read_in_pieces_of_any_size(size: int) -> None:
    assert fed(EXAMPLE + REFUSAL + EXAMPLE, size)[0] == [
        RegisterAnswer((555, 0, 100)),
        RegisterAnswer((), 2),
        RegisterAnswer((555, 0, 100)),
    ]


def test_weights_are_32_bits_high_word_first_and_signed() -> None:
    assert decode_weights((0x8001, 0xFFFF, 0xFC18, 0x0001, 0x0000)) == ScaleWeights(0x8001, -1000, 65_536)


def test_a_damaged_answer_is_counted_and_the_next_one_read() -> None:
    answers, counters = fed(b"\x07noise" + EXAMPLE[:5] + b"\xff" + EXAMPLE[6:] + EXAMPLE)
    assert (answers, counters.checksum_errors) == ([RegisterAnswer((555, 0, 100))], 1)


def test_another_slaves_answer_is_none() -> None:
    assert fed(bytes.fromhex("09 03 02 00 01 99 85"))[0] == []


@given(st.lists(st.binary(max_size=120) | st.sampled_from([EXAMPLE, REFUSAL, b"\x01\x03"]), max_size=8))
def test_whatever_comes_it_holds_less_than_one_answer(pieces: list[bytes]) -> None:
    decoder = AnswerDecoder(1, LinkCounters())
    for piece in pieces:
        decoder.feed(piece)
        assert decoder.held < LONGEST
