"""Frames of poses to samples: what is absent is invalid, what is old is passed over, what is lost is counted."""

import math

from drivers.poses import PoseFrames, ToolPose
from drivers.roles import LinkCounters
from rig.channels import MarkerSample
from rig.config.products.openigtlink import OpenIgtLinkWiring

POSE = ToolPose(1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, math.nan)
PERIOD_NS = 10_000_000


class Stream:
    """Frames numbered in steps of 10 ms of the tracker's time, each 3 ms under way."""

    def __init__(self) -> None:
        self.counters = LinkCounters()
        self.frames = PoseFrames(OpenIgtLinkWiring(tools=("tip", "arm"), latency_ms=2.0), self.counters)

    def take(self, number: int, poses: dict[str, ToolPose], age_ns: int = 0) -> list[MarkerSample]:
        taken_ns = number * PERIOD_NS - age_ns
        return self.frames.samples(number, taken_ns, poses, 7_000_000_000 + taken_ns + 3_000_000)


def test_a_tool_that_is_not_in_the_frame_is_invalid_and_nowhere() -> None:
    tip, arm = Stream().take(1, {"tip": POSE})
    assert (tip.valid, tip.x_mm, tip.tool, arm.valid, arm.tool) == (1, 1.0, 0, 0, 1)
    assert all(map(math.isnan, (arm.x_mm, arm.y_mm, arm.z_mm, arm.q0)))


def test_a_place_that_is_no_number_is_invalid() -> None:
    tip, _ = Stream().take(1, {"tip": POSE._replace(y_mm=math.inf)})
    assert (tip.valid, math.isnan(tip.x_mm)) == (0, True)


def test_a_frame_is_dated_by_the_trackers_clock_less_the_known_latency() -> None:
    stream = Stream()
    first = stream.take(1, {"tip": POSE})[0]
    late = stream.frames.samples(2, 2 * PERIOD_NS, {"tip": POSE}, 7_000_000_000 + 2 * PERIOD_NS + 9_000_000)[0]
    assert first.arrival_ns - first.capture_ns == 2_000_000
    # Until clocks are known to agree, they may drift by 300 ppm: 3 us in 10 ms.
    assert abs(late.capture_ns - first.capture_ns - PERIOD_NS) <= 3_000


def test_numbers_passed_over_are_lost_and_older_frames_are_repeats() -> None:
    stream = Stream()
    stream.take(1, {})
    stream.take(4, {})
    assert stream.take(3, {}) == [] and stream.take(4, {}) == []
    assert (stream.counters.frames, stream.counters.device_lost, stream.counters.repeated) == (2, 2, 2)


def test_a_tracker_that_counts_anew_is_followed_and_sample_numbers_go_on() -> None:
    stream = Stream()
    stream.take(1000, {"tip": POSE})
    samples = stream.take(1, {"tip": POSE})
    assert [sample.seq for sample in samples] == [2, 3]
    assert samples[0].capture_ns > 0


def test_time_that_runs_back_begins_a_new_clock() -> None:
    stream = Stream()
    before = stream.take(1, {"tip": POSE})[0]
    after = stream.take(2, {"tip": POSE}, age_ns=500_000_000)
    assert after and after[0].capture_ns > before.capture_ns
