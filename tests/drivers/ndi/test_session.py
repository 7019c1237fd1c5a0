"""The session with the tracker: mock and driver in one process, and time passes when the test says so."""

import itertools
import math
from collections.abc import Iterator

import pytest

from drivers.ndi.device import LOST_AFTER_NS, REPLY_TIMEOUT_NS, NdiTracker
from drivers.ndi.frames import FrameReader
from drivers.ndi.replies import ToolReading, TrackingReply
from drivers.ports import PortClosed
from drivers.roles import LinkCounters
from mock_devices.testing.ndi import ARM, MS, TIP, TrackerBench, run, started
from rig.config.products.ndi_polaris import PolarisWiring
from rig.errors import DeviceError

FRAME_NS = 1_000_000_000 // 60


@pytest.fixture
def bench() -> Iterator[TrackerBench]:
    bench = TrackerBench()
    yield bench
    bench.release()


@pytest.mark.parametrize("reply", ["BX", "TX"])
def test_each_frame_brings_one_sample_a_tool(bench: TrackerBench, reply: str) -> None:
    device = started(bench, reply=reply)
    samples = run(bench, device, 100, 1100)
    frames = sorted({sample.frame for sample in samples})
    assert len(samples) == 2 * len(frames)
    assert frames == list(range(frames[0], frames[0] + len(frames)))
    assert len(frames) >= 60
    assert device.counters.frames == len(frames)
    assert device.counters.device_lost == 0


@pytest.mark.parametrize("reply", ["BX", "TX"])
def test_a_sample_carries_pose_tool_and_fit_error(bench: TrackerBench, reply: str) -> None:
    tip, arm = run(bench, started(bench, reply=reply), 100, 130)[:2]
    assert (tip.tool, arm.tool) == (0, 1)
    assert (tip.x_mm, tip.y_mm, tip.z_mm) == TIP[:3]
    assert (tip.q0, tip.qx, tip.qy, tip.qz, tip.error_mm) == TIP[3:]
    assert (arm.x_mm, arm.y_mm, arm.z_mm, arm.q0, arm.error_mm) == (-250.0, 100.0, -1500.0, 1.0, ARM.error_mm)
    assert (tip.valid, arm.valid) == (1, 1)


def test_sequence_numbers_have_no_hole(bench: TrackerBench) -> None:
    samples = run(bench, started(bench), 100, 600)
    assert [sample.seq for sample in samples] == list(range(len(samples)))


def test_a_new_frame_is_met_within_four_milliseconds(bench: TrackerBench) -> None:
    """Of the injected clock: the questions come closer together when a frame is due."""
    for sample in run(bench, started(bench), 100, 1100)[2:]:
        became_available_ns = sample.frame * 1_000_000_000 // 60
        assert 0 <= sample.arrival_ns - became_available_ns <= 4 * MS


def test_capture_times_are_a_frame_apart_and_never_after_arrival(bench: TrackerBench) -> None:
    samples = run(bench, started(bench), 100, 3100)[0::2]
    assert all(sample.capture_ns <= sample.arrival_ns for sample in samples)
    late = samples[60:]
    steps = [b.capture_ns - a.capture_ns for a, b in itertools.pairwise(late)]
    assert all(abs(step - FRAME_NS) < 0.1 * MS for step in steps)


def test_a_question_asked_late_is_dated_when_it_went_out(bench: TrackerBench) -> None:
    """A host that stops for 8 ms before each question would take the frames for that much older than they are."""
    device = NdiTracker(bench.open, PolarisWiring(), lambda: 10**9)
    device.start()
    bench.run_until(100 * MS)
    assert not device.poll(10**9 - 8 * MS)
    assert [sample.capture_ns for sample in device.poll(10**9 + MS)] == [10**9, 10**9]


def test_capture_times_of_each_tool_differ(bench: TrackerBench) -> None:
    samples = run(bench, started(bench), 100, 1100)
    for tool in (0, 1):
        captures = [sample.capture_ns for sample in samples if sample.tool == tool]
        assert all(late > early for early, late in itertools.pairwise(captures))


def test_the_known_latency_lies_between_capture_and_arrival(bench: TrackerBench) -> None:
    plain = run(bench, started(bench), 100, 600)[-1]
    other = TrackerBench()
    late = run(other, started(other, latency_ms=20.0), 100, 600)[-1]
    other.release()
    assert plain.frame == late.frame
    assert plain.capture_ns - late.capture_ns == 20 * MS


def test_the_questions_are_no_more_than_three_a_frame(bench: TrackerBench) -> None:
    device = started(bench)
    asked = len(bench.commands)
    run(bench, device, 100, 1100)
    assert 60 <= len(bench.commands) - asked <= 3 * 60


def test_a_missing_tool_is_invalid_and_its_pose_is_no_number(bench: TrackerBench) -> None:
    device = started(bench)
    bench.mock.missing = {1}
    tip, arm = run(bench, device, 100, 130)[:2]
    assert (tip.valid, arm.valid) == (1, 0)
    assert arm.frame == tip.frame
    assert all(math.isnan(value) for value in arm[5:13])


def test_a_tool_hidden_from_the_camera_is_missing(bench: TrackerBench) -> None:
    device = started(bench)
    bench.plant.view = [None, ARM]
    assert [sample.valid for sample in run(bench, device, 100, 130)[:2]] == [0, 1]


@pytest.mark.parametrize("reply", ["BX", "TX"])
def test_a_tool_pulled_out_is_invalid_in_the_frames_of_the_others(bench: TrackerBench, reply: str) -> None:
    device = started(bench, reply=reply)
    bench.mock.unplugged = {0}
    tip, arm = run(bench, device, 100, 130)[:2]
    assert (tip.valid, arm.valid) == (0, 1)
    assert tip.frame == arm.frame


def test_frames_passed_over_are_counted_as_lost(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    samples = run(bench, device, 400, 500)
    assert device.counters.device_lost == samples[0].frame - 12
    assert device.counters.frames + device.counters.device_lost == samples[-1].frame - 5


def test_at_20_Hz_every_third_number_is_a_frame(bench: TrackerBench) -> None:
    device = started(bench, rate_Hz=20.0)
    assert device.period_ns == 50 * MS
    for third in range(2, 40):
        bench.mock.frozen = False
        bench.run_until(third * 50 * MS)
        bench.mock.frozen = True
        device.poll(third * 50 * MS)
        device.poll(third * 50 * MS + MS)
    assert device.counters.frames > 30
    assert device.counters.device_lost == 0


def test_a_frame_number_that_stands_still_brings_nothing(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    bench.mock.frozen = True
    run(bench, device, 200, 210)
    assert run(bench, device, 210, 3000) == []


def test_a_damaged_reply_is_counted_and_asked_for_again_at_once(bench: TrackerBench) -> None:
    device = started(bench)
    bench.mock.corrupt_every = 5
    samples = run(bench, device, 100, 1100)
    assert device.counters.checksum_errors >= 10
    assert device.counters.discarded_bytes > 0
    assert device.counters.device_lost == 0
    assert len(samples) >= 2 * 59


def test_a_reply_that_never_comes_is_asked_for_again(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    bench.mock.silent = True
    asked = len(bench.commands)
    run(bench, device, 200, 500)
    assert len(bench.commands) - asked in (1, 2)
    bench.mock.silent = False
    assert run(bench, device, 500, 500 + REPLY_TIMEOUT_NS // MS + 20)


def test_a_tracker_silent_after_start_is_lost(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    bench.mock.silent = True
    with pytest.raises(DeviceError, match=r"gave no good reply to BX for 1 s.*check power and cable"):
        run(bench, device, 200, 200 + 2 * LOST_AFTER_NS // MS)


def test_a_tracker_that_sends_only_damaged_replies_is_lost(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    bench.mock.corrupt_every = 1
    with pytest.raises(DeviceError, match="no good reply"):
        run(bench, device, 200, 200 + 2 * LOST_AFTER_NS // MS)
    assert device.counters.checksum_errors > 100


def test_a_pause_of_the_host_is_no_loss_of_the_tracker(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    assert run(bench, device, 60_000, 60_100)


def test_an_error_reply_is_told_in_words(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    bench.mock.error_reply = 0x0C
    with pytest.raises(DeviceError, match=r"refused BX \(ERROR0C: command not allowed in the present mode\)"):
        run(bench, device, 200, 300)


def test_a_tracker_that_restarts_by_itself_is_told(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    bench.wire.sent.append(b"RESETBE6F\r")
    with pytest.raises(DeviceError, match="restarted by itself; check its power"):
        run(bench, device, 200, 300)


def test_a_cut_cable_ends_the_poll(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    bench.cut = True
    with pytest.raises(PortClosed, match="the other end closed"):
        run(bench, device, 200, 300)


def test_a_reply_that_is_no_tracking_data_is_counted_and_asked_for_again(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    discarded = device.counters.discarded_bytes
    bench.wire.sent.append(b"OKAYA896\r")
    assert run(bench, device, 200, 300)
    assert device.counters.discarded_bytes == discarded + 4


def test_a_question_that_is_held_up_on_its_way_dates_no_later_frame_too_early() -> None:
    """The tracker answers it with the newest frame, which was taken long after the question had been sent."""
    reader = FrameReader([1], PolarisWiring(), LinkCounters())

    def captured_ns(frame: int, way_ns: int) -> int:
        """Of a frame that is heard 2 ms after it was taken, where the question was ``way_ns`` on its way."""
        heard_ns = frame * 1_000_000_000 // 60 + 2 * MS
        tool = ToolReading(1, "MISSING", 0, frame)
        (sample,) = reader.samples(TrackingReply((tool,), 0), heard_ns - way_ns, heard_ns + 3 * MS)
        return sample.capture_ns - heard_ns

    before = [captured_ns(frame, MS) for frame in range(1, 120)]
    held_up = captured_ns(120, 80 * MS)
    after = [captured_ns(frame, MS) for frame in range(121, 240)]
    assert [*before[60:], held_up, *after] == pytest.approx([-MS] * 179, abs=0.1 * MS)
