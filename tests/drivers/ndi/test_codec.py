"""Framing of the combined API: what goes out, and how replies are cut out of whatever comes in."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.ndi.codec import (
    MAX_REPLY,
    BinaryReply,
    Reply,
    ReplyDecoder,
    TextReply,
    encode_binary,
    encode_command,
    encode_text,
)

TX_REPLY = (
    b"0301+05000-05000+05000-05000+001225-003450-100000+0125000000031000001F4\n"
    b"02MISSING00000031000001F4\n"
    b"03DISABLED\n"
    b"0080155F\r"
)
BX_BODY = bytes.fromhex(
    "03"  # three handles
    "01 01"  # handle 1, valid: q0 qx qy qz, x y z, error
    "0000003f 000000bf 0000003f 000000bf 00004441 00000ac2 00007ac4 0000003e"
    "31000000 f4010000"  # port status, frame 500
    "02 02 31000000 f4010000"  # handle 2, missing
    "03 04"  # handle 3, disabled
    "8000"  # system status: a port became unoccupied
)
BX_REPLY = bytes.fromhex("c4a5 3900 3f43") + BX_BODY + bytes.fromhex("7b2e")
EXTENDED_BX_REPLY = bytes.fromhex("c8a5 39000000 50cd") + BX_BODY + bytes.fromhex("7b2e")

replies = st.one_of(
    st.builds(TextReply, st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E) | st.just("\n"), max_size=200)),
    st.builds(BinaryReply, st.binary(max_size=200)),
)


def encoded(reply: Reply, extended: bool = False) -> bytes:
    return encode_text(reply.text) if isinstance(reply, TextReply) else encode_binary(reply.body, extended)


@pytest.mark.parametrize(
    ("name", "params", "wire"),
    [
        ("INIT", "", b"INIT:E3A5\r"),
        ("VER", "0", b"VER:065EE\r"),
        ("GETINFO", "Features.Firmware.Version", b"GETINFO:Features.Firmware.Version0492\r"),
        ("PHRQ", "*********1****", b"PHRQ:*********1****A4C1\r"),
        ("PENA", "01D", b"PENA:01D6D3B\r"),
        ("TSTART", "", b"TSTART:5423\r"),
        ("TX", "0001", b"TX:0001031A\r"),
        ("BX", "0001", b"BX:0001C26D\r"),
    ],
)
def test_a_command_ends_in_its_checksum_and_cr(name: str, params: str, wire: bytes) -> None:
    assert encode_command(name, params) == wire


def test_a_command_without_checksum_has_a_space_in_place_of_the_colon() -> None:
    assert encode_command("TX", "0001", crc=False) == b"TX 0001\r"


@pytest.mark.parametrize(
    ("wire", "text"),
    [(b"OKAYA896\r", "OKAY"), (b"RESETBE6F\r", "RESET"), (b"ERROR0C4E42\r", "ERROR0C"), (b"WARNING7423\r", "WARNING")],
)
def test_a_text_reply_is_given_without_checksum_and_cr(wire: bytes, text: str) -> None:
    assert ReplyDecoder().feed(wire) == [TextReply(text)]


def test_a_tx_reply_keeps_its_line_feeds() -> None:
    (reply,) = ReplyDecoder().feed(TX_REPLY)
    assert reply == TextReply(TX_REPLY[:-5].decode())


@pytest.mark.parametrize("wire", [BX_REPLY, EXTENDED_BX_REPLY], ids=["short header", "extended header"])
def test_a_binary_reply_is_given_without_header_and_checksum(wire: bytes) -> None:
    assert ReplyDecoder().feed(wire) == [BinaryReply(BX_BODY)]


@pytest.mark.parametrize("wire", [TX_REPLY, BX_REPLY, EXTENDED_BX_REPLY, b"OKAYA896\r"])
def test_a_reply_may_be_split_at_every_byte(wire: bytes) -> None:
    whole = ReplyDecoder().feed(wire)
    for cut in range(1, len(wire)):
        decoder = ReplyDecoder()
        assert decoder.feed(wire[:cut]) == []
        assert decoder.pending == cut
        assert decoder.feed(wire[cut:]) == whole
        assert (decoder.pending, decoder.discarded_bytes, decoder.checksum_errors) == (0, 0, 0)


def test_single_bytes_make_the_same_replies() -> None:
    decoder = ReplyDecoder()
    wire = BX_REPLY + TX_REPLY + EXTENDED_BX_REPLY
    found = [reply for byte in wire for reply in decoder.feed(bytes([byte]))]
    assert found == ReplyDecoder().feed(wire)
    assert len(found) == 3


@pytest.mark.parametrize(
    "garbage", [b"\x00", b"\xff\xfe\x01", b"\xc4", b"\xc4\xc8\xc4", b"\r", b"\x00\r\xff", b"~\x00"]
)
def test_garbage_between_replies_is_dropped_and_counted(garbage: bytes) -> None:
    decoder = ReplyDecoder()
    wire = garbage + BX_REPLY + garbage + b"OKAYA896\r" + garbage + BX_REPLY
    assert decoder.feed(wire) == [BinaryReply(BX_BODY), TextReply("OKAY"), BinaryReply(BX_BODY)]
    assert decoder.discarded_bytes == 3 * len(garbage)
    assert decoder.checksum_errors == 0


@pytest.mark.parametrize("at", range(len(b"OKAYA896")))
def test_a_wrong_byte_in_a_text_reply_costs_that_reply_only(at: int) -> None:
    damaged = bytearray(b"OKAYA896\r")
    damaged[at] ^= 0x01
    decoder = ReplyDecoder()
    assert decoder.feed(bytes(damaged) + b"RESETBE6F\r") == [TextReply("RESET")]
    assert (decoder.checksum_errors, decoder.discarded_bytes) == (1, 9)


@pytest.mark.parametrize("wire", [BX_REPLY, EXTENDED_BX_REPLY], ids=["short header", "extended header"])
def test_a_wrong_byte_anywhere_in_a_binary_reply_costs_that_reply_only(wire: bytes) -> None:
    for at in range(len(wire)):
        damaged = bytearray(wire)
        damaged[at] ^= 0x40
        decoder = ReplyDecoder()
        assert decoder.feed(bytes(damaged) + BX_REPLY) == [BinaryReply(BX_BODY)], at
        assert decoder.discarded_bytes == len(wire)


def test_a_wrong_header_checksum_is_counted_before_the_length_is_believed() -> None:
    decoder = ReplyDecoder()
    lying = b"\xc4\xa5\xff\x0f\x00\x00"
    assert decoder.feed(lying + BX_REPLY) == [BinaryReply(BX_BODY)]
    assert decoder.checksum_errors == 1


def test_a_wrong_body_checksum_is_counted_once() -> None:
    decoder = ReplyDecoder()
    damaged = BX_REPLY[:-1] + bytes([BX_REPLY[-1] ^ 1])
    assert decoder.feed(damaged) == []
    assert (decoder.checksum_errors, decoder.discarded_bytes, decoder.pending) == (1, len(BX_REPLY), 0)


@pytest.mark.parametrize("lost", range(6, len(BX_REPLY)))
def test_a_byte_lost_in_a_body_does_not_cost_the_next_reply(lost: int) -> None:
    decoder = ReplyDecoder()
    assert decoder.feed(BX_REPLY[:lost] + BX_REPLY[lost + 1 :] + BX_REPLY) == [BinaryReply(BX_BODY)]
    assert decoder.discarded_bytes == len(BX_REPLY) - 1


def test_the_longest_reply_is_read_and_a_longer_one_is_not_waited_for() -> None:
    decoder = ReplyDecoder()
    assert decoder.feed(encode_binary(b"\0" * MAX_REPLY)) == [BinaryReply(b"\0" * MAX_REPLY)]
    header_alone = encode_binary(b"\0" * (MAX_REPLY + 1))[:6]
    assert decoder.feed(header_alone + BX_REPLY) == [BinaryReply(BX_BODY)]
    assert (decoder.checksum_errors, decoder.discarded_bytes) == (0, 6)


def test_a_line_without_end_is_dropped_and_memory_stays_bounded() -> None:
    decoder = ReplyDecoder()
    for _ in range(100):
        assert decoder.feed(b"A" * 1000) == []
        assert decoder.pending <= MAX_REPLY
    assert decoder.feed(b"\rOKAYA896\r") == [TextReply("OKAY")]
    assert decoder.discarded_bytes == 100_001


def test_what_will_not_be_completed_can_be_dropped() -> None:
    decoder = ReplyDecoder()
    decoder.feed(BX_REPLY[:20])
    decoder.reset()
    assert (decoder.pending, decoder.discarded_bytes) == (0, 20)
    assert decoder.feed(BX_REPLY) == [BinaryReply(BX_BODY)]


@given(st.lists(replies, max_size=6), st.booleans(), st.data())
def test_replies_survive_any_chunks(sent: list[Reply], extended: bool, data: st.DataObject) -> None:
    wire = b"".join(encoded(reply, extended) for reply in sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(wire)), max_size=8)))
    decoder = ReplyDecoder()
    got = [
        reply
        for start, end in zip([0, *cuts], [*cuts, len(wire)], strict=True)
        for reply in decoder.feed(wire[start:end])
    ]
    assert got == sent
    assert (decoder.pending, decoder.discarded_bytes, decoder.checksum_errors) == (0, 0, 0)


@given(st.lists(st.one_of(st.binary(max_size=60), replies.map(encoded), st.just(BX_REPLY[:30])), max_size=20))
def test_any_bytes_are_accounted_for_and_never_raise(chunks: list[bytes]) -> None:
    decoder = ReplyDecoder()
    used = 0
    for chunk in chunks:
        for reply in decoder.feed(chunk):
            # Short and extended headers differ by two bytes; which it was shows in what is left over.
            used += len(encoded(reply))
    fed = sum(map(len, chunks))
    rest = fed - used - decoder.discarded_bytes - decoder.pending
    assert rest >= 0
    assert rest % 2 == 0
    assert decoder.pending <= MAX_REPLY + 10


@given(st.binary(max_size=300))
def test_after_any_bytes_and_a_reset_the_next_reply_is_read(garbage: bytes) -> None:
    decoder = ReplyDecoder()
    decoder.feed(garbage)
    decoder.reset()
    assert decoder.feed(BX_REPLY) == [BinaryReply(BX_BODY)]
