"""The limb in the robot's frame, from markers, wherever the camera stands: only motion against the robot counts."""

import math

import numpy as np
import pytest

from controller.loop.registration import Point, Registration

MS = 1_000_000
DIRECTION = np.array([0.12, 0.25, -0.9608])
TIP, ARM = np.array([35.0, -60.0, -1400.0]), np.array([95.0, -40.0, -1405.0])


def frames(
    registration: Registration, positions_mm: "np.ndarray[tuple[int], np.dtype[np.float64]]", start: int = 0,
    limb: tuple[float, float, float] = (0.0, 0.0, 0.0), camera: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:  # fmt: skip
    """Frames at 60 Hz with the tracker's noise: the axis at each position, limb and camera shifted."""
    noise = np.random.default_rng(start)
    for frame, position_mm in enumerate(positions_mm, start):
        captured_ns = frame * 16_666_667
        registration.axis(captured_ns, position_mm)
        seen = -np.array(camera)
        tip = TIP + DIRECTION * position_mm + seen + noise.normal(0, 0.06, 3)
        registration.tip(frame, captured_ns, Point(*tip))
        registration.arm(frame, Point(*(ARM + np.array(limb) + seen + noise.normal(0, 0.06, 3))))


APPROACHING = np.linspace(0.0, 20.0, 240)


def test_before_the_axis_has_travelled_nothing_is_said() -> None:
    registration = Registration(MS)
    frames(registration, np.linspace(0.0, 4.0, 60))
    assert math.isnan(registration.moved_mm)


def test_a_limb_at_rest_has_not_moved_while_the_axis_goes_on() -> None:
    registration = Registration(MS)
    frames(registration, APPROACHING)
    frames(registration, np.linspace(20.0, 5.0, 240), start=240)
    assert registration.moved_mm < 0.5


def test_a_limb_that_moved_is_seen_by_how_much() -> None:
    registration = Registration(MS)
    frames(registration, APPROACHING)
    frames(registration, np.full(20, 20.0), start=240, limb=(3.0, 0.0, 4.0))
    assert registration.moved_mm == pytest.approx(5.0, abs=0.5)


def test_a_camera_that_is_pushed_does_not_count_as_a_limb_that_moved() -> None:
    registration = Registration(MS)
    frames(registration, APPROACHING)
    frames(registration, np.full(20, 20.0), start=240, camera=(0.0, 30.0, 0.0))
    assert registration.moved_mm < 0.5


def test_a_new_program_starts_from_where_the_limb_is() -> None:
    registration = Registration(MS)
    frames(registration, APPROACHING)
    registration.begin()
    frames(registration, APPROACHING, start=240, limb=(20.0, 0.0, 0.0))
    assert registration.moved_mm < 0.5


def scale_of(scale: float, positions_mm: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> Registration:
    """The registration of an axis that says ``positions_mm`` and goes ``scale`` times as far."""
    registration = Registration(MS)
    for frame, position_mm in enumerate(positions_mm):
        captured_ns = frame * 16_666_667
        registration.axis(captured_ns, position_mm)
        tip = TIP + DIRECTION * scale * position_mm + np.random.default_rng(frame).normal(0, 0.06, 3)
        registration.tip(frame, captured_ns, Point(*tip))
    return registration


def test_the_scale_of_the_axis_is_unknown_until_it_has_travelled_two_millimetres() -> None:
    assert scale_of(1.0, np.linspace(0.0, 1.9, 60)).scale is None
    assert scale_of(1.0, np.linspace(0.0, 2.1, 15)).scale is None
    assert scale_of(1.0, np.linspace(0.0, 2.1, 60)).scale is not None


@pytest.mark.parametrize("scale", [0.5, 0.9, 1.0, 2.0])
def test_the_interval_of_the_scale_holds_the_truth_and_is_as_wide_as_its_closed_form(scale: float) -> None:
    positions_mm = np.linspace(0.0, 7.9, 96)
    known = scale_of(scale, positions_mm).scale
    assert known is not None and known.low < scale < known.high
    spread = float(np.sum((positions_mm - positions_mm.mean()) ** 2))
    assert (known.high - known.low) / 2 == pytest.approx(3.29 * 0.06 / math.sqrt(spread), rel=0.15)


def test_a_frame_between_two_samples_of_the_axis_is_placed_between_them() -> None:
    registration = Registration(MS)
    for sample in range(12):
        registration.axis(sample * 100_000_000, 1.0 * sample)
    for frame in range(60):
        captured_ns = frame * 16_666_667
        place = TIP + np.array([0.0, 0.0, 1.0]) * captured_ns * 1e-8
        registration.tip(frame, captured_ns, Point(*place))
    assert registration.scale is not None
    assert registration.scale.high - registration.scale.low < 1e-3
    assert registration.scale.low == pytest.approx(1.0, abs=1e-3)


def test_frames_that_are_dated_wrongly_bend_no_scale_where_the_axis_had_rested_before() -> None:
    registration, late_s = Registration(MS), 0.05
    for milli in range(1000):
        registration.axis(milli * 1_000_000, moved_mm(milli * 1e-3))
        if milli % 16 == 0:
            place = TIP + np.array([0.0, 0.0, 1.0]) * moved_mm(milli * 1e-3 - late_s)
            registration.tip(milli // 16, milli * 1_000_000, Point(*place))
    known = registration.scale
    assert known is not None and 0.5 * (known.low + known.high) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("latency_s", [0.0, 0.015, 0.034, 0.04])
@pytest.mark.parametrize("scale", [0.88, 1.0, 1.12])
def test_a_tracker_that_is_late_bends_no_scale_where_the_axis_turns(scale: float, latency_s: float) -> None:
    """A slow touch, 2 mm back, then a fast press: at one lag all frames lie on one line, whose slope is the scale."""
    speeds_mm_s = [0.0] * 300 + [6.0] * 700 + [0.0] * 150 + [-20.0] * 100 + [30.0] * 250
    at_mm = np.cumsum(np.array(speeds_mm_s) * 1e-3)
    registration, noise = Registration(MS), np.random.default_rng(47)
    for milli, position_mm in enumerate(at_mm):
        registration.axis(milli * 1_000_000, position_mm)
        if milli % 16 == 0:
            seen_mm = scale * np.interp(milli * 1e-3 - latency_s, np.arange(at_mm.size) * 1e-3, at_mm)
            place = TIP + DIRECTION * seen_mm + noise.normal(0.0, 0.06, 3)
            registration.tip(milli // 16, milli * 1_000_000, Point(*place))
    known = registration.scale
    assert known is not None and known.low - 0.02 < scale < known.high + 0.02
    assert known.high - known.low < 0.05


@pytest.mark.parametrize(("held_up_ms", "counted"), [(22, True), (23, False)])
def test_a_frame_counts_up_to_22_ms_after_the_newest_report_of_an_axis_at_1_kHz(held_up_ms: int, counted: bool) -> None:
    registration = Registration(MS)
    frames(registration, APPROACHING)
    newest_ns = 239 * 16_666_667
    for frame in range(240, 252):
        registration.tip(frame, newest_ns + held_up_ms * MS, Point(*(TIP + DIRECTION * 20.0)))
        registration.arm(frame, Point(*(ARM + np.array([0.0, 9.0, 12.0]))))
    assert (registration.moved_mm > 10.0) is counted


def test_frames_while_the_reports_of_the_axis_are_held_up_bend_neither_scale_nor_place() -> None:
    """30 mm/s, of which 150 ms are reported only afterwards: 4.5 mm by which the frames would be placed wrongly."""
    registration, late = Registration(MS), list[int]()
    for milli in range(800):
        late.append(milli)
        if not 400 <= milli < 550:
            for sampled in late:
                registration.axis(sampled * MS, 0.03 * sampled)
            late.clear()
        if milli % 16 == 0:
            registration.tip(milli // 16, milli * MS, Point(*(TIP + DIRECTION * 0.03 * milli)))
            registration.arm(milli // 16, Point(*ARM))
            known = registration.scale
            assert known is None or 0.5 * (known.low + known.high) == pytest.approx(1.0, abs=0.01), milli
            assert not registration.moved_mm > 1.0, milli
    assert registration.registered


def moved_mm(time_s: float) -> float:
    """Half a second of rest, then 20 mm/s."""
    return 20.0 * max(time_s - 0.5, 0.0)
