"""The chain: every effect vanishes at its null, and does what its statement says off it."""

from collections.abc import Mapping

import numpy as np
import pytest

from rig.diagnosis.indentation import library, nulls
from rig.diagnosis.problem import Effect, operators
from rig.simulation import chain
from rig.simulation.drive import Array, MeasuredMotion

BASE = {"a_N_mm": 0.2, "b_per_mm": 0.2, "damping_N_s_mm": 0.01, "surface_mm": 2.0, "zero_N": 0.1}


def stroke_drive(speed_mm_s: float = 10.0, period_s: float = 0.004) -> MeasuredMotion:
    """Two equal cycles from 2 mm above the surface to 6 mm below it, hold, and out."""
    corners = np.cumsum([0, 0.3, 8 / speed_mm_s, 0.5, 8 / speed_mm_s, 0.3])
    time = np.arange(0, corners[-1], period_s)
    position = np.interp(time, corners, [0, 0, 8, 8, 0, 0])
    velocity = np.gradient(position, period_s)
    both = np.concatenate([time, time + 10])
    recording = np.repeat([0, 1], len(time)).astype(np.int64)
    frames = np.arange(0.5, len(both) - 1, 4.0)
    return MeasuredMotion(
        both, period_s, recording, np.tile(position, 2), np.tile(velocity, 2),
        np.tile(np.gradient(velocity, period_s), 2), recording.astype(float), np.linspace(20, 25, len(both)),
        frames, recording[frames.astype(int)],
    )  # fmt: skip


def respond(drive: MeasuredMotion, values: Mapping[str, float]) -> chain.Response:
    """What the sensors read with the causes that are off their null."""
    values = {**nulls(), **values}
    return chain.respond(drive, values, operators(library("index"), values))


def force_with(**values: float) -> Array:
    """Force of the chain with these parameters beside the base."""
    return respond(stroke_drive(), {**BASE, **values}).force_N


def beside(effect: Effect) -> dict[str, float]:
    """One step of every cause without which this one means nothing."""
    found = dict[str, float]()
    while effect.beside:
        effect = next(other for other in library("index") if other.name == effect.beside)
        found |= {par.name: par.null + par.scale for par in effect.amplitudes}
    return found


@pytest.mark.parametrize("effect", library("index"), ids=lambda effect: effect.key)
def test_every_effect_vanishes_at_its_null_and_shows_off_it(effect: Effect) -> None:
    drive = stroke_drive()
    own = {par.name: par.null for par in effect.pars}
    assert all(nulls()[name] == value or par_is_shape(effect, name) for name, value in own.items())
    known = BASE | beside(effect)
    plain, off = respond(drive, known), respond(drive, {**known, **own})
    np.testing.assert_array_equal(plain.force_N, off.force_N)
    np.testing.assert_array_equal(plain.tip_mm, off.tip_mm)
    moved = respond(
        drive, {**known, **own, effect.amplitudes[0].name: effect.amplitudes[0].null + effect.amplitudes[0].scale}
    )
    change = np.abs(moved.force_N - plain.force_N).max() + np.abs(moved.tip_mm - plain.tip_mm).max()
    assert change > 1e-6


def par_is_shape(effect: Effect, name: str) -> bool:
    """Whether the parameter only shapes the effect."""
    return name in {par.name for par in effect.shapes}


def test_without_any_effect_the_force_is_the_study_s_law() -> None:
    drive = stroke_drive()
    depth = drive.position_mm - 2.0
    inside = depth > 0.6
    expected = 0.2 * depth * np.exp(0.2 * depth) + 0.01 * drive.velocity_mm_s + 0.1
    np.testing.assert_allclose(respond(drive, BASE).force_N[inside], expected[inside], atol=1e-9)
    np.testing.assert_allclose(respond(drive, BASE).force_N[depth < -0.1], 0.1, atol=1e-12)


def test_a_compliant_frame_keeps_the_tip_behind_by_compliance_times_force() -> None:
    drive = stroke_drive()
    response = respond(drive, {**BASE, "frame_compliance_mm_N": 0.05, "damping_N_s_mm": 0.0})
    at_rest = np.abs(drive.velocity_mm_s) < 1e-9
    behind = drive.at_tracker(np.where(at_rest, drive.position_mm - 0.05 * (response.force_N - 0.1), np.nan))
    seen = np.isfinite(behind)
    assert seen.sum() > 20
    np.testing.assert_allclose(response.tip_mm[seen], behind[seen], atol=2e-4)


def test_a_time_offset_delays_the_force_by_itself() -> None:
    drive = stroke_drive()
    late = respond(drive, {**BASE, "time_offset_s": 2 * drive.period_s}).force_N
    plain = respond(drive, BASE).force_N
    np.testing.assert_allclose(late[2 : drive.starts[1]], plain[: drive.starts[1] - 2], atol=1e-9)


def test_relaxation_lowers_the_force_in_the_hold_and_nowhere_before_contact() -> None:
    drive = stroke_drive()
    change = force_with(relaxation_ratio=0.3, tau_s=0.3) - force_with()
    hold = (drive.position_mm > 7.99) & (drive.recording == 0)
    assert np.all(np.diff(change[hold]) < 0)
    np.testing.assert_allclose(change[drive.in_recording_s < 0.4], 0, atol=1e-12)
