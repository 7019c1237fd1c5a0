"""The channel between processes: what is sent arrives once and in order, and what is damaged is counted, not met."""

import socket
import struct
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig import channel
from rig.channel import (
    HEADER_BYTES,
    MARK,
    Answer,
    Channel,
    Message,
    Outbox,
    Parser,
    Received,
    encode,
    pair,
    refuse_oversized,
)
from rig.errors import UsageError


class Said(Message, kind=40):
    text: str = ""
    value: float = 0.0


class Shown(Message, kind=41):
    number: int


class Foreign(Message, kind=49):
    """Known to nobody."""


Ends = tuple[Channel, Channel]


@pytest.fixture
def ends() -> Iterator[Ends]:
    one, other = pair()
    mine, theirs = Channel(one, [Said, Shown]), Channel(other, [Said, Shown])
    yield mine, theirs
    mine.close()
    theirs.close()


bodies = st.lists(st.binary(max_size=60), min_size=1, max_size=8)


def stream_of(parts: list[bytes]) -> bytes:
    return b"".join(encode(number, 40, body) for number, body in enumerate(parts))


@given(bodies, st.integers(1, 40))
def test_frames_arrive_whole_however_their_bytes_are_cut(parts: list[bytes], size: int) -> None:
    parser, stream = Parser(), stream_of(parts)
    frames = [frame for at in range(0, len(stream), size) for frame in parser.feed(stream[at : at + size])]
    assert [(frame.id, frame.type, frame.body) for frame in frames] == [(n, 40, body) for n, body in enumerate(parts)]
    assert parser.damaged == 0


@given(st.binary(max_size=400), st.integers(1, 60))
def test_bytes_that_are_no_frame_never_raise_and_are_counted(noise: bytes, size: int) -> None:
    parser = Parser()
    for at in range(0, len(noise), size):
        assert parser.feed(noise[at : at + size]) == []
    assert parser.damaged > 0 or len(noise) < HEADER_BYTES


@given(bodies, st.data())
def test_a_flipped_bit_costs_its_frame_and_is_never_taken_for_a_message(
    parts: list[bytes], data: st.DataObject
) -> None:
    stream = bytearray(stream_of(parts))
    at = data.draw(st.integers(0, len(stream) - 1))
    stream[at] ^= 1 << data.draw(st.integers(0, 7))
    parser = Parser()
    # What follows pushes out a frame whose length the flip made larger.
    frames = parser.feed(bytes(stream)) + parser.feed(encode(99, 40, b"end") * 3)
    sent = {(number, body) for number, body in enumerate(parts)}
    kept = {(frame.id, frame.body) for frame in frames if not frame.refused and frame.id != 99}
    assert kept < sent
    assert len(sent) - len(kept) == 1
    assert parser.damaged > 0


@given(bodies, st.data())
def test_missing_bytes_cost_at_most_two_frames(parts: list[bytes], data: st.DataObject) -> None:
    stream = stream_of(parts)
    at = data.draw(st.integers(0, len(stream) - 1))
    gone = data.draw(st.integers(1, HEADER_BYTES))
    parser = Parser()
    frames = parser.feed(stream[:at] + stream[at + gone :]) + parser.feed(encode(99, 40, b"end") * 3)
    assert [frame.id for frame in frames][-3:] == [99, 99, 99]
    kept = [frame for frame in frames if frame.id != 99]
    assert all(frame.body == parts[frame.id] for frame in kept)
    assert len(kept) >= len(parts) - 2


def test_a_frame_above_the_limit_is_refused_with_its_id_and_what_follows_is_read() -> None:
    parser = Parser(limit_bytes=10)
    stream = encode(7, 40, b"x" * 5000) + encode(8, 40, b"short")
    frames = [frame for at in range(0, len(stream), 700) for frame in parser.feed(stream[at : at + 700])]
    assert [(frame.id, frame.body) for frame in frames] == [(7, b""), (8, b"short")]
    assert frames[0].refused == "a message of 5000 bytes is above the 10 allowed"


def test_the_layout_of_a_frame_is_as_described() -> None:
    frame = encode(0x01020304, 0x0506, b"{}")
    assert frame[:4] == MARK
    assert struct.unpack_from("<IIH", frame, 4) == (2, 0x01020304, 0x0506)
    assert frame[HEADER_BYTES:] == b"{}"


def test_messages_go_both_ways_with_ids_to_answer(ends: Ends) -> None:
    mine, theirs = ends
    first, second = mine.send(Said(text="a")), mine.send(Said(value=2.5))
    got = theirs.receive_all()
    assert [(received.id, received.message) for received in got] == [
        (first, Said(text="a")),
        (second, Said(value=2.5)),
    ]
    theirs.send(Answer(to=second, refused="no"))
    received = mine.receive()
    assert received is not None
    assert received.message == Answer(to=second, refused="no")


def test_receive_takes_one_message_at_a_time(ends: Ends) -> None:
    mine, theirs = ends
    for number in range(3):
        mine.send(Shown(number=number))
    taken = [theirs.receive() for _ in range(4)]
    assert [received and received.message for received in taken] == [*(Shown(number=n) for n in range(3)), None]


@pytest.mark.parametrize(
    ("frame", "sentence"),
    [
        (encode(5, 49, b"{}"), "messages of type 49 are not known here"),
        (encode(5, 41, b'{"number": 1.5}'), "a message of type Shown is not understood: number: "),
        (encode(5, 41, b'{"number": 1, "more": 2}'), "more: Extra inputs are not permitted"),
        (encode(5, 41, b"\xff{"), "a message of type Shown is not understood"),
        (encode(5, 40, b'{"value": NaN}'), "value: Input should be a finite number"),
        (encode(5, 41, b"[" * 100_000), "a message of type Shown is not understood"),
        (encode(5, 40, b" " * 400_001), "a message of 400001 bytes is above the 400000 allowed"),
    ],
)
def test_what_is_not_understood_is_answered_by_its_id_and_counted(ends: Ends, frame: bytes, sentence: str) -> None:
    mine, theirs = ends
    raw = socket.socket(fileno=socket.dup(mine.fileno()))
    raw.setblocking(False)
    sent = 0
    while sent < len(frame):
        try:
            sent += raw.send(frame[sent:])
        except BlockingIOError:
            theirs.receive()
    raw.close()
    got = [theirs.receive() for _ in range(20)]
    assert got == [None] * 20
    assert theirs.refused == 1
    received = mine.receive()
    assert received is not None
    assert isinstance(received.message, Answer)
    assert received.message.to == 5
    assert sentence in received.message.refused


def test_an_answer_that_is_not_understood_is_not_answered(ends: Ends) -> None:
    mine, theirs = ends
    raw = socket.socket(fileno=socket.dup(mine.fileno()))
    raw.send(encode(5, Answer.TYPE, b'{"to": "you"}'))
    raw.close()
    assert theirs.receive() is None
    assert (theirs.refused, mine.receive()) == (1, None)


@given(st.lists(st.one_of(st.binary(max_size=80), st.just(encode(3, 41, b'{"number": 3}'))), max_size=12))
def test_a_channel_fed_with_anything_never_raises_and_reads_what_is_sound(pieces: list[bytes]) -> None:
    one, other = pair()
    end = Channel(other, [Shown])
    one.setblocking(False)
    sound = 0
    for piece in pieces:
        one.send(piece) if piece else None
        sound += piece.startswith(MARK) and len(piece) > HEADER_BYTES
    found = [received.message for received in (end.receive() for _ in range(len(pieces) + 2)) if received]
    assert all(message == Shown(number=3) for message in found)
    assert len(found) <= sound
    one.close()
    end.close()


def test_a_message_larger_than_the_socket_takes_goes_out_in_pieces(ends: Ends) -> None:
    mine, theirs = ends
    text = "x" * 390_000
    assert mine.send(Said(text=text)) == 1
    assert not mine.flush()
    found: list[Received] = []
    while not found:
        mine.flush()
        found = theirs.receive_all()
    assert found[0].message == Said(text=text)
    assert mine.flush()


def test_sending_to_one_who_does_not_read_never_waits_and_is_bounded(ends: Ends) -> None:
    mine, _ = ends
    sent = [mine.send(Said(text="x" * 10_000)) for _ in range(channel.OUTBOX_MESSAGES + 100)]
    kept = sum(1 for number in sent if number)
    assert channel.OUTBOX_MESSAGES < kept < len(sent)
    assert mine.dropped == len(sent) - kept


def test_of_what_is_only_shown_the_newest_waits_and_nothing_kept_is_lost(ends: Ends) -> None:
    mine, theirs = ends
    while mine.flush():
        mine.send(Said(text="x" * 10_000))
    for number in range(50):
        mine.send_newest(Shown(number=number))
    mine.send(Said(text="last"))
    texts, shown = [], []
    for _ in range(200):
        mine.flush()
        for received in theirs.receive_all():
            if isinstance(received.message, Said):
                texts.append(received.message.text)
            elif isinstance(received.message, Shown):
                shown.append(received.message.number)
    assert texts[-1] == "last"
    assert shown == [49]
    assert mine.dropped == 0


def test_a_message_in_pieces_is_not_cut_by_a_newer_one() -> None:
    outbox = Outbox()
    outbox.put_newest(b"first")
    assert bytes(outbox.due()) == b"first"
    outbox.written(2)
    outbox.put_newest(b"second")
    outbox.put_newest(b"third")
    assert bytes(outbox.due()) == b"rst"
    outbox.written(3)
    assert bytes(outbox.due()) == b"third"


def test_what_cannot_be_sent_is_dropped_and_counted(ends: Ends) -> None:
    mine, theirs = ends
    assert mine.send(Said(text="x" * 400_001)) == 0
    assert mine.send(Said(text="\ud800")) == 0
    assert (mine.dropped, theirs.receive()) == (2, None)


def test_the_end_of_the_other_end_is_noticed(ends: Ends) -> None:
    mine, theirs = ends
    mine.send(Said(text="last words"))
    mine.close()
    received = theirs.receive()
    assert received is not None
    assert received.message == Said(text="last words")
    assert theirs.receive() is None
    assert theirs.lost
    assert theirs.send(Said()) > 0
    assert theirs.lost


def test_a_message_too_large_is_refused_before_it_is_sent() -> None:
    refuse_oversized(Said(text="x"), "it")
    with pytest.raises(UsageError, match=r"push takes 4000\d\d bytes as a message, and one may have 400000;"):
        refuse_oversized(Said(text="x" * 400_001), "push")
