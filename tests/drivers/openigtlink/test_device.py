"""The OpenIGTLink session with scripted bytes: start, frames, what a server may do wrong."""

import pytest

from drivers.openigtlink import codec
from drivers.openigtlink.device import OpenIgtLinkTracker
from drivers.poses import ToolPose
from mock_devices.testing.clock import Clock
from rig.config.products.openigtlink import OpenIgtLinkWiring
from rig.errors import DeviceError
from tests.drivers.scripted_port import ScriptedPort

POSE = ToolPose(1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 0.0)
FRAME_NS = 16_000_000
FIRST_NS = 1_700_000_000_000_000_000


def transform(tool: str, frame: int, shift_ns: int = 0) -> bytes:
    return codec.encode("TRANSFORM", tool, codec.encode_transform(POSE), FIRST_NS + frame * FRAME_NS + shift_ns)


class Session:
    """A driver on a scripted port; ``start`` finds one frame that waits already."""

    def __init__(self, waiting: bytes = transform("tip", 0) + transform("arm", 0), **settings: object) -> None:
        self.port, self.clock = ScriptedPort(), Clock()
        config = OpenIgtLinkWiring.model_validate({"port": "tcp://camera:18944", **settings})
        self.tracker = OpenIgtLinkTracker(lambda: self.port, config, self.clock)
        self.port.push(waiting)

    def frame(self, *messages: bytes) -> list[tuple[int, int, int]]:
        """(frame, tool, valid) of what comes of ``messages`` one frame later."""
        self.clock.advance(FRAME_NS * 1e-9)
        self.port.push(b"".join(messages))
        return [(sample.frame, sample.tool, sample.valid) for sample in self.tracker.poll(self.clock())]


def started(waiting: bytes = transform("tip", 0) + transform("arm", 0), **settings: object) -> Session:
    session = Session(waiting, **settings)
    session.tracker.start()
    assert session.frame() == [(1, 0, 1), (1, 1, 1)]
    return session


def test_what_came_while_it_started_is_not_lost() -> None:
    session = started()
    assert session.tracker.identity.serial == "camera:18944"
    assert session.tracker.identity.settings == {"stream": "TRANSFORM", "clock": "sender's"}


@pytest.mark.parametrize("place", range(50, len(transform("tip", 0)), 3))
def test_a_first_message_with_a_damaged_checksum_or_body_is_passed_over(place: int) -> None:
    first = bytearray(transform("tip", 0))
    first[place] ^= 4
    session = Session(bytes(first) + transform("tip", 1) + transform("arm", 1))
    session.tracker.start()
    assert session.frame() == [(1, 0, 1), (1, 1, 1)]


def test_tools_with_one_time_are_one_frame() -> None:
    session = started()
    assert session.frame(transform("tip", 1)) == []
    assert session.frame(transform("arm", 1, 900_000)) == [(2, 0, 1), (2, 1, 1)]


def test_a_tool_that_is_left_out_is_invalid_once_the_next_frame_begins() -> None:
    session = started()
    session.frame(transform("tip", 1))
    assert session.frame(transform("tip", 2)) == [(2, 0, 1), (2, 1, 0)]


def test_a_tool_of_another_name_is_nothing() -> None:
    session = started()
    assert session.frame(transform("needle", 1)) == []


def test_a_matrix_of_zeros_is_an_invalid_tool() -> None:
    session = started()
    nothing = codec.encode("TRANSFORM", "arm", bytes(48), FIRST_NS + FRAME_NS)
    assert session.frame(transform("tip", 1), nothing) == [(2, 0, 1), (2, 1, 0)]


def test_tracking_data_are_asked_for_and_ended() -> None:
    both = codec.encode_tools([("tip", POSE), ("arm", POSE)])
    session = started(stream="TDATA", rate_Hz=50.0, waiting=codec.encode("TDATA", "Tracker", both, FIRST_NS))
    asked = session.port.written[0]
    assert asked[2:14] == b"STT_TDATA\0\0\0"
    assert asked[:2] == b"\0\x02" and asked[70:74] == b"\0\0\0\x14"  # behind the extended header: 20 ms
    alone = codec.encode("TDATA", "Tracker", codec.encode_tools([("arm", POSE)]), FIRST_NS + FRAME_NS)
    assert session.frame(alone) == [(2, 0, 0), (2, 1, 1)]
    session.tracker.close()
    assert session.port.written[-1][2:14] == b"STP_TDATA\0\0\0"


def test_earlier_versions_ask_without_an_extended_header() -> None:
    both = codec.encode_tools([("tip", POSE), ("arm", POSE)])
    session = started(stream="TDATA", version=2, waiting=codec.encode("TDATA", "Tracker", both, FIRST_NS))
    assert session.port.written[0][:2] == b"\0\x01" and len(session.port.written[0]) == 58 + 36


def test_a_sender_without_a_clock_is_dated_by_arrival() -> None:
    still = codec.encode("TRANSFORM", "tip", codec.encode_transform(POSE)) + codec.encode(
        "TRANSFORM", "arm", codec.encode_transform(POSE)
    )
    session = Session(waiting=still)
    session.tracker.start()
    assert session.tracker.identity.settings["clock"] == "none: time of arrival"
    session.clock.advance(0.016)
    assert [sample.capture_ns for sample in session.tracker.poll(session.clock())] == [session.clock()] * 2
    session.clock.advance(0.016)
    session.port.push(still)
    assert [sample.capture_ns for sample in session.tracker.poll(session.clock())] == [session.clock()] * 2


def test_a_server_that_falls_silent_is_lost() -> None:
    session = started()
    session.clock.advance(1.1)
    with pytest.raises(DeviceError, match=r"tcp://camera:18944: no tool came for 1 s; check the tracker"):
        session.tracker.poll(session.clock())


def test_a_server_of_other_tools_is_refused_with_their_names() -> None:
    session = Session(waiting=transform("needle", 0) + transform("probe", 0))
    session.tracker = OpenIgtLinkTracker(
        lambda: session.port, OpenIgtLinkWiring(port="tcp://camera:18944"), _hurrying(session.clock)
    )
    with pytest.raises(DeviceError) as refusal:
        session.tracker.start()
    assert str(refusal.value) == (
        "tcp://camera:18944: no TRANSFORM message of tip, arm within 3 s; it sends needle, probe: name those in"
        " tracker.tools; check that the server tracks, and tracker.stream"
    )
    assert session.port.closed


def _hurrying(clock: Clock) -> Clock:
    class Hurrying(Clock):
        def __call__(self) -> int:
            self.advance(1.0)
            return self.now_ns

    return Hurrying(clock.now_ns)


def test_a_name_that_no_header_can_hold_is_refused_in_the_configuration() -> None:
    with pytest.raises(ValueError, match="'a tool with a long name' is longer than the 20 bytes"):
        OpenIgtLinkWiring(tools=("a tool with a long name",))


def test_it_is_not_asked_before_its_start() -> None:
    with pytest.raises(DeviceError, match="not started"):
        Session().tracker.fileno()
