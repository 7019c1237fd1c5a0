"""Real sessions of Polaris and Aurora trackers, recorded by the IGSTK project in 2005 (its licence lies beside them).

The binary one has LF where the wire had CR; the others write CR and LF as escapes.
"""

import itertools
import re
from typing import NamedTuple

import pytest

from drivers.ndi import codec, replies
from tests.data import recording

# Replies in each.
SESSIONS = {
    "aurora_stream_09_28_2005.txt": 91,
    "polaris_stream_07_27_2005.txt": 25,
    "polaris_stream_09_29_2005.txt": 81,
    "polaris_stream_11_05_2005.txt": 53,
    "polaris_stream_08_29_2005.bin": 204,
}
_ENTRY = re.compile(rb"\d+\. (command|receive)\[(\d+)\] ")


class Exchange(NamedTuple):
    """One entry of a session: a command that went out, or a reply that came in."""

    sent: bool
    wire: bytes


def session(name: str) -> list[Exchange]:
    data = recording(f"ndi_captures/{name}").read_bytes()
    escaped = name.endswith(".txt")
    entries = []
    for match in _ENTRY.finditer(data):
        size = int(match[2])
        if escaped:
            line = data[match.end() : data.index(b"\n", match.end())]
            wire = re.sub(rb"\\x([0-9A-F]{2})", lambda code: bytes([int(code[1], 16)]), line)
        else:
            wire = data[match.end() : match.end() + size - 1] + b"\r"
        entries.append(Exchange(match[1] == b"command", wire))
        assert len(wire) == size
    return entries


@pytest.mark.parametrize("name", SESSIONS)
def test_every_reply_of_a_real_session_has_its_checksum_right(name: str) -> None:
    received = [entry.wire for entry in session(name) if not entry.sent]
    decoder = codec.ReplyDecoder()
    found = decoder.feed(b"".join(received))
    assert len(found) == len(received) == SESSIONS[name]
    assert (decoder.checksum_errors, decoder.discarded_bytes, decoder.pending) == (0, 0, 0)


@pytest.mark.parametrize("name", SESSIONS)
def test_every_command_of_a_real_session_is_encoded_to_the_same_bytes(name: str) -> None:
    for wire in (entry.wire for entry in session(name) if entry.sent):
        command, _, rest = wire.decode().partition(":")
        assert codec.encode_command(command, rest[:-5]) == wire


def tracking(name: str) -> list[replies.TrackingReply]:
    """All replies to TX that carry poses."""
    found = []
    entries = session(name)
    for command, answer in itertools.pairwise(entries):
        if command.sent and command.wire.startswith(b"TX:") and not answer.sent:
            options = int(command.wire[3:7], 16)
            (reply,) = codec.ReplyDecoder().feed(answer.wire)
            if options & replies.TRANSFORMS and isinstance(reply, codec.TextReply):
                parsed = replies.parse_tx(reply.text, options)
                assert parsed is not None, answer.wire
                found.append(parsed)
    return found


def test_a_tool_comes_into_view_and_its_frame_number_advances() -> None:
    tools = [reply.tools[0] for reply in tracking("polaris_stream_07_27_2005.txt")]
    assert [isinstance(tool.pose, replies.Pose) for tool in tools] == [False] * 2 + [True] * 8
    frames = [tool.frame for tool in tools if tool.frame is not None]
    assert frames == sorted(set(frames))
    for tool in tools:
        if isinstance(tool.pose, replies.Pose):
            assert sum(q * q for q in tool.pose[:4]) == pytest.approx(1, abs=4e-4)  # four digits each


def test_a_tool_pulled_out_while_tracking_turns_from_missing_to_disabled() -> None:
    states = [reply.tools[2].pose for reply in tracking("polaris_stream_08_29_2005.bin")]
    first = states.index(replies.DISABLED)
    assert set(states[:first]) == {replies.MISSING}
    assert set(states[first:]) == {replies.DISABLED}


def test_a_port_that_became_unoccupied_shows_in_the_system_status() -> None:
    statuses = [reply.system_status for reply in tracking("polaris_stream_08_29_2005.bin")]
    assert not statuses[0] & 0x0080
    assert statuses[-1] & 0x0080


def test_errors_and_warnings_of_real_trackers_are_understood() -> None:
    texts = [
        reply.text
        for name in SESSIONS
        for reply in codec.ReplyDecoder().feed(b"".join(entry.wire for entry in session(name) if not entry.sent))
        if isinstance(reply, codec.TextReply)
    ]
    codes = [code for text in texts if (code := replies.parse_error(text)) is not None]
    assert [replies.error_words(code) for code in codes] == ["ERROR08: invalid port handle"]
    assert sum(replies.is_warning(text) for text in texts) == 1
    versions = [version for text in texts if (version := replies.parse_version(text))]
    assert [version.freeze_tag for version in versions] == ["POLARIS Rev 020", "POLARIS Rev 021"]
