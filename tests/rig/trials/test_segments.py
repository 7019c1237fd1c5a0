"""Segments of motions that are made piece by piece, so that every boundary is known; it is found to two samples."""

from itertools import pairwise

import numpy as np
import pytest

from rig.recording.converter import Array
from rig.trials.cycles import cut, cycle_of
from rig.trials.segments import Kind, Segment, rows_in, segments_of
from rig.trials.trial import Trial

SURFACE_MM = 5.0
# Time and place of the corners: at rest in the air, in, held at 8 mm of depth, out.
STUDY = ((0.0, 0.0), (0.4, 0.0), (1.05, 13.0), (1.55, 13.0), (2.85, 0.0), (3.2, 0.0))
# In at 20 mm/s the surface is met at 0.65 s, out at 10 mm/s at 2.35 s.
STUDY_SEGMENTS: list[tuple[Kind, float]] = [
    ("air", 0.0),
    ("loading", 0.65),
    ("hold", 1.05),
    ("unloading", 1.55),
    ("air", 2.35),
]


def sampled(corners: tuple[tuple[float, float], ...], rate_Hz: float) -> tuple[Array, Array]:
    """A motion straight from corner to corner, sampled evenly."""
    at_s, place_mm = np.array(corners).T
    time_s = np.arange(at_s[0], at_s[-1] + 0.5 / rate_Hz, 1 / rate_Hz)
    return time_s, np.interp(time_s, at_s, place_mm)


def ends(segments: tuple[Segment, ...], time_s: Array) -> list[tuple[Kind, float]]:
    """Kinds, and when each began."""
    return [(segment.kind, float(time_s[segment.rows.start])) for segment in segments]


def assert_segments(found: list[tuple[Kind, float]], expected: list[tuple[Kind, float]], within_s: float) -> None:
    assert [kind for kind, _ in found] == [kind for kind, _ in expected]
    assert [start for _, start in found] == pytest.approx([start for _, start in expected], abs=within_s)


@pytest.mark.parametrize(
    ("rate_Hz", "noise_mm"), [(1000.0, 0.0), (1000.0, 0.0005), (1000.0, 0.01), (100.0, 0.0), (20.0, 0.0)]
)
def test_the_studys_cycle(rate_Hz: float, noise_mm: float) -> None:
    time_s, place_mm = sampled(STUDY, rate_Hz)
    place_mm = place_mm + np.random.default_rng(1).normal(0, noise_mm, len(time_s))
    assert_segments(ends(segments_of(time_s, place_mm, SURFACE_MM), time_s), STUDY_SEGMENTS, 1.5 / rate_Hz + 0.01)


def test_every_row_is_in_one_segment() -> None:
    time_s, place_mm = sampled(STUDY, 300.0)
    found = segments_of(time_s, place_mm, SURFACE_MM)
    assert found[0].rows.start == 0
    assert found[-1].rows.stop == len(time_s)
    assert all(one.rows.stop == other.rows.start and one.kind != other.kind for one, other in pairwise(found))


@pytest.mark.parametrize("rests_s", [0.3, 1.0])
@pytest.mark.parametrize("noise_mm", [0.0, 0.002])
def test_steps_at_10_Hz_are_a_way_in_and_the_rest_at_its_end_is_a_hold(rests_s: float, noise_mm: float) -> None:
    corners = [(0.0, 0.0)]
    for step in range(1, 21):
        corners += [(corners[-1][0] + rests_s, (step - 1) * 0.5), (corners[-1][0] + rests_s + 0.1, step * 0.5)]
    deep_s = corners[-1][0]
    corners += [(deep_s + 20.0, 10.0), (deep_s + 21.0, 0.0)]
    time_s, place_mm = sampled(tuple(corners), 10.0)
    place_mm = place_mm + np.random.default_rng(2).normal(0, noise_mm, len(time_s))
    found = ends(segments_of(time_s, place_mm, 4.9), time_s)
    # The surface is in the tenth step.
    expected: list[tuple[Kind, float]] = [
        ("air", 0.0),
        ("loading", 10 * (rests_s + 0.1)),
        ("hold", deep_s),
        ("unloading", deep_s + 20.0),
        ("air", deep_s + 20.5),
    ]
    assert_segments(found, expected, 0.25)


def test_two_depths_are_two_holds() -> None:
    corners = ((0.0, 0.0), (0.65, 8.0), (1.15, 8.0), (1.5, 13.0), (2.0, 13.0), (3.3, 0.0))
    time_s, place_mm = sampled(corners, 500.0)
    found = ends(segments_of(time_s, place_mm, SURFACE_MM), time_s)
    kinds = [kind for kind, _ in found]
    assert kinds == ["air", "loading", "hold", "loading", "hold", "unloading", "air"]
    assert found[2][1] == pytest.approx(0.65, abs=0.01)
    assert found[3][1] == pytest.approx(1.15, abs=0.01)


def test_a_staircase_of_long_rests_is_holds() -> None:
    corners = [(0.0, 0.0)]
    for step in range(1, 6):
        corners += [(corners[-1][0] + 0.2, 2.0 * step), (corners[-1][0] + 30.2, 2.0 * step)]
    time_s, place_mm = sampled(tuple(corners), 50.0)
    found = segments_of(time_s, place_mm, -np.inf)
    assert [one.kind for one in found] == ["loading", "hold"] * 5
    assert all(one.took_s(time_s) == pytest.approx(30.0, abs=0.1) for one in found if one.kind == "hold")


@pytest.mark.parametrize("surface_mm", [-0.5, 0.0])
def test_a_start_in_contact_has_no_air_before(surface_mm: float) -> None:
    corners = ((0.0, 0.0), (1.0, 0.0), (3.0, 6.0), (5.0, 6.0))
    time_s, place_mm = sampled(corners, 100.0)
    found = ends(segments_of(time_s, place_mm, surface_mm), time_s)
    assert_segments(found, [("hold", 0.0), ("loading", 1.0), ("hold", 3.0)], 0.025)


def test_a_fast_approach_does_not_make_a_slow_loading_a_hold() -> None:
    corners = ((0.0, 0.0), (0.25, 5.0), (30.25, 8.0), (40.25, 8.0), (40.65, 0.0))
    time_s, place_mm = sampled(corners, 200.0)
    place_mm = place_mm + np.random.default_rng(3).normal(0, 0.0005, len(time_s))
    found = ends(segments_of(time_s, place_mm, SURFACE_MM), time_s)
    assert [kind for kind, _ in found] == ["air", "loading", "hold", "unloading", "air"]
    assert found[2][1] == pytest.approx(30.25, abs=0.05)


def test_a_second_slower_speed_in_the_tissue_is_no_hold() -> None:
    time_s, place_mm = sampled(((0.0, 0.0), (0.35, 7.0), (10.35, 9.0), (12.35, 9.0), (12.8, 0.0)), 200.0)
    place_mm = place_mm + np.random.default_rng(6).normal(0, 0.005, len(time_s))
    found = ends(segments_of(time_s, place_mm, SURFACE_MM), time_s)
    assert [kind for kind, _ in found] == ["air", "loading", "hold", "unloading", "air"]
    assert found[2][1] == pytest.approx(10.35, abs=0.2)


def test_a_slow_way_in_that_an_encoder_rounds_is_no_hold() -> None:
    time_s, place_mm = sampled(((0.0, 0.0), (100.0, 2.0), (140.0, 2.0), (240.0, 0.0)), 20.0)
    found = ends(segments_of(time_s, np.round(place_mm / 0.01) * 0.01, -np.inf), time_s)
    assert_segments(found, [("loading", 0.0), ("hold", 100.0), ("unloading", 140.0)], 2.0)


def test_a_slow_way_out_is_no_hold() -> None:
    corners = ((0.0, 0.0), (0.5, 10.0), (1.0, 10.0), (11.0, 0.0))
    time_s, place_mm = sampled(corners, 200.0)
    found = ends(segments_of(time_s, place_mm, -np.inf), time_s)
    assert_segments(found, [("loading", 0.0), ("hold", 0.5), ("unloading", 1.0)], 0.02)


@pytest.mark.parametrize("acceleration_mm_s2", [2000.0, 200.0])
def test_a_turn_without_a_rest_is_no_hold(acceleration_mm_s2: float) -> None:
    time_s = np.linspace(0.0, 1.0, 1001)
    away_s, turn_s = np.abs(time_s - 0.5), 30 / acceleration_mm_s2
    slow_mm, fast_mm = acceleration_mm_s2 / 2 * away_s**2, 30 * (away_s - turn_s / 2)
    place_mm = 12.0 - np.where(away_s < turn_s, slow_mm, fast_mm)
    found = ends(segments_of(time_s, place_mm, -np.inf), time_s)
    assert_segments(found, [("loading", 0.0), ("unloading", 0.5)], 0.02)


def test_a_dither_is_no_hold() -> None:
    time_s = np.arange(0.0, 2.0, 0.002)
    place_mm = np.where(time_s < 0.5, 20 * time_s, 10 + 0.25 * np.sin(2 * np.pi * 6 * (time_s - 0.5)))
    found = segments_of(time_s, place_mm, -np.inf)
    assert {one.kind for one in found} == {"loading", "unloading"}


def test_tension_turned_round_is_as_compression() -> None:
    corners = ((0.0, 0.0), (10.0, 20.0), (12.0, 20.0), (22.0, 0.0))
    time_s, place_mm = sampled(corners, 10.0)
    found = ends(segments_of(time_s, place_mm, 0.0), time_s)
    assert_segments(found, [("loading", 0.0), ("hold", 10.0), ("unloading", 12.0)], 0.25)


def test_uneven_sampling_finds_the_same() -> None:
    even_s = np.arange(0.0, 3.2, 0.01)
    time_s = np.sort(even_s + np.random.default_rng(4).uniform(0, 0.009, len(even_s)))
    time_s = np.delete(time_s, slice(70, 75))
    at_s, corner_mm = np.array(STUDY).T
    found = ends(segments_of(time_s, np.interp(time_s, at_s, corner_mm), SURFACE_MM), time_s)
    assert_segments(found, STUDY_SEGMENTS, 0.04)


def test_an_encoder_that_rounds_finds_the_same() -> None:
    time_s, place_mm = sampled(STUDY, 1000.0)
    noisy_mm = place_mm + np.random.default_rng(5).normal(0, 0.003, len(time_s))
    found = ends(segments_of(time_s, np.round(noisy_mm / 0.01) * 0.01, SURFACE_MM), time_s)
    assert [kind for kind, _ in found] == ["air", "loading", "hold", "unloading", "air"]


def test_cycles_inside_a_recording_have_their_own() -> None:
    one_s, one_mm = sampled(STUDY, 100.0)
    time_s, place_mm = np.concatenate([one_s, one_s + 3.21, one_s + 6.42]), np.tile(one_mm, 3)
    force_N = np.maximum(place_mm - SURFACE_MM, 0.0)
    cycles = [cycle_of(part) for part in cut(Trial("t", time_s, force_N, time_s, place_mm))]
    assert len(cycles) == 3
    for cycle in cycles:
        kinds = [one.kind for one in segments_of(cycle.time_s, cycle.position_mm, SURFACE_MM)]
        assert kinds == ["air", "loading", "hold", "unloading", "air"]


def test_rows_of_a_hold_that_has_settled() -> None:
    time_s, place_mm = sampled(STUDY, 100.0)
    found = segments_of(time_s, place_mm, SURFACE_MM)
    settled = rows_in(found, "hold", time_s, after_s=0.3)
    assert time_s[settled].min() == pytest.approx(1.35, abs=0.02)
    assert time_s[settled].max() == pytest.approx(1.55, abs=0.025)


def test_fewer_than_two_samples_are_no_segment() -> None:
    assert segments_of(np.zeros(0), np.zeros(0), 0.0) == ()
    assert segments_of(np.zeros(1), np.zeros(1), 0.0) == ()


def test_a_tip_that_never_moves_holds_or_is_in_the_air() -> None:
    time_s, place_mm = np.linspace(0.0, 4.9, 50), np.full(50, 3.0)
    assert [one.kind for one in segments_of(time_s, place_mm, 5.0)] == ["air"]
    assert [one.kind for one in segments_of(time_s, place_mm, 1.0)] == ["hold"]
