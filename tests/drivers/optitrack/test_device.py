"""The session with Motive by scripted datagrams: who, which bodies, frames, and what may go wrong."""

import time

import pytest

from drivers.optitrack import packets
from drivers.optitrack.device import OptiTrackTracker
from mock_devices.interfaces import MarkerPose
from mock_devices.optitrack.packets import frame, models, server_information
from mock_devices.testing.clock import Clock
from rig.channels import MarkerSample
from rig.config.products.optitrack_natnet import NatNetWiring
from rig.errors import DeviceError
from tests.drivers.optitrack.scripted import ScriptedLink

POSE = MarkerPose(1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 0.5)
VERSION = (4, 1)
TICKS = 10_000_000


def frame_of(number: int, *seen: MarkerPose | None, ticks: int | None = None) -> bytes:
    stamp = number * TICKS // 120 if ticks is None else ticks
    return packets.encode_packet(packets.FRAME, frame(number, seen or (POSE, POSE), stamp, VERSION))


class Session:
    def __init__(self, **settings: object) -> None:
        self.link, self.clock = ScriptedLink(), Clock()
        self.link.answers = {
            packets.CONNECT: packets.encode_packet(packets.SERVER_INFO, server_information(VERSION, 1511)),
            packets.REQUEST_MODELS: packets.encode_packet(packets.MODELS, models(("tip", "arm"), VERSION)),
            packets.KEEP_ALIVE: frame_of(100),
        }
        config = NatNetWiring.model_validate({"port": "udp://motive:1510", **settings})
        self.tracker = OptiTrackTracker(lambda: self.link, config, self.clock)

    def poll(self, *datagrams: bytes) -> list[MarkerSample]:
        self.clock.advance(1 / 120)
        for datagram in datagrams:
            self.link.push(datagram)
        return self.tracker.poll(self.clock())


def started(**settings: object) -> Session:
    session = Session(**settings)
    session.tracker.start()
    session.link.answers.clear()
    return session


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.optitrack.device.ANSWER_S", 0.01)


def test_it_says_who_streams() -> None:
    identity = started().tracker.identity
    assert (identity.product, identity.serial, identity.firmware) == (
        "optitrack-natnet", "motive:1510", "Motive 3.1.0.1",
    )  # fmt: skip
    assert identity.settings == {"natnet": "4.1", "clock": "10000000 Hz"}


@pytest.mark.parametrize("question", [packets.CONNECT, packets.REQUEST_MODELS, packets.KEEP_ALIVE])
@pytest.mark.parametrize("kept", [0, 3, 20, -1])
def test_any_one_damaged_answer_at_set_up_is_asked_for_again(question: int, kept: int) -> None:
    session = Session()
    session.link.spoilt[question] = kept
    session.tracker._now = time.monotonic_ns  # a question that is repeated waits
    session.tracker.start()
    assert session.tracker.identity.serial == "motive:1510"
    assert session.link.sent.count(question) == 2 and len(session.link.sent) == 4


def test_bodies_and_markers_are_tools() -> None:
    session = started(tools=("tip", "arm", "tip/2"))
    samples = session.poll(frame_of(101))
    assert [(sample.tool, sample.valid, round(sample.x_mm, 3)) for sample in samples] == [
        (tool, 1, 1.0) for tool in (0, 1, 2)
    ]
    assert samples[0].q0 == 1.0
    assert samples[2].y_mm == pytest.approx(32.0)


def test_a_body_that_is_not_tracked_is_invalid_though_it_has_a_place() -> None:
    session = started(tools=("tip", "arm", "arm/1"))
    assert [(s.tool, s.valid) for s in session.poll(frame_of(101, POSE, None))] == [(0, 1), (1, 0), (2, 0)]


def test_frames_that_were_passed_over_are_counted_and_late_ones_dropped() -> None:
    session = started()
    session.poll(frame_of(101))
    assert [sample.frame for sample in session.poll(frame_of(105), frame_of(103))] == [105, 105]
    assert (session.tracker.counters.device_lost, session.tracker.counters.repeated) == (3, 1)


def test_without_ticks_a_frame_is_dated_by_its_number() -> None:
    session = started()
    first, second = (session.poll(frame_of(number, ticks=0))[0] for number in (101, 102))
    assert second.capture_ns - first.capture_ns == pytest.approx(1e9 / 120, abs=5_000)


def test_a_damaged_datagram_is_counted_and_survived() -> None:
    session = started()
    cut = frame_of(101)[:-30]
    short = packets.encode_packet(packets.FRAME, frame_of(102)[4:60])
    assert len(session.poll(cut, short, b"\x07", frame_of(103))) == 2
    assert session.tracker.counters.checksum_errors == 3


def test_bodies_that_are_defined_anew_are_followed() -> None:
    session = started()
    session.link.push(packets.encode_packet(packets.MODELS, models(("arm", "tip"), VERSION)))
    samples = session.poll(frame_of(101, None, POSE))
    assert [(sample.tool, sample.valid) for sample in samples] == [(0, 1), (1, 0)]


def test_it_keeps_motive_sending() -> None:
    session = started()
    session.link.sent.clear()
    for number in range(101, 101 + 360):
        session.poll(frame_of(number))
    assert session.link.sent == [packets.KEEP_ALIVE] * 2


def test_silence_is_told_after_a_second() -> None:
    session = started()
    session.clock.advance(1.1)
    with pytest.raises(DeviceError, match=r"udp://motive:1510: no frame for 1 s; check Motive's streaming"):
        session.tracker.poll(session.clock())


def _impatient(session: Session) -> None:
    class Hurrying(Clock):
        def __call__(self) -> int:
            self.advance(0.004)
            return self.now_ns

    session.tracker._now = Hurrying(session.clock.now_ns)


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        (packets.CONNECT, "did not say who it is in 4 tries"),
        (packets.REQUEST_MODELS, "did not say its rigid bodies in 4 tries"),
        (packets.KEEP_ALIVE, "did not say a frame in 4 tries"),
    ],
)
def test_what_motive_does_not_say_is_told(message: int, sentence: str) -> None:
    session = Session()
    del session.link.answers[message]
    _impatient(session)
    with pytest.raises(DeviceError, match=sentence):
        session.tracker.start()
    assert session.link.closed and session.link.sent.count(message) == 4


def test_an_old_layout_is_refused_in_words() -> None:
    session = Session()
    session.link.answers[packets.CONNECT] = packets.encode_packet(
        packets.SERVER_INFO, server_information((2, 10), 1511)
    )
    with pytest.raises(DeviceError, match=r"Motive streams NatNet 2\.10, and 3 or 4 is understood"):
        session.tracker.start()


def test_a_body_that_is_not_defined_is_refused_with_those_that_are() -> None:
    with pytest.raises(DeviceError, match=r"no rigid body 'needle'; it has tip, arm: name those in tracker\.tools"):
        Session(tools=("tip", "needle/1")).tracker.start()


def test_a_tool_is_a_body_or_one_of_its_markers() -> None:
    with pytest.raises(ValueError, match="'tip/second' is neither a rigid body nor one of its markers"):
        NatNetWiring(tools=("tip/second",))


def test_it_is_not_asked_before_its_start() -> None:
    with pytest.raises(DeviceError, match="not started"):
        Session().tracker.poll(0)


def test_who_only_asks_who_streams_needs_no_name_of_a_body() -> None:
    session = Session(tools=("another", "third"))
    assert session.tracker.identify().firmware == "Motive 3.1.0.1"
    assert session.link.sent == [packets.CONNECT]
    assert session.link.closed


def test_frames_that_come_together_are_none_taken_after_they_came() -> None:
    session = started()
    samples = session.poll(*(frame_of(101 + number) for number in range(4)))
    taken_ns = [sample.capture_ns for sample in samples if sample.tool == 0]
    assert len(taken_ns) == 4 and taken_ns == sorted(set(taken_ns))
    assert all(sample.capture_ns <= sample.arrival_ns for sample in samples)
