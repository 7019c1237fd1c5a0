"""The working grid: derivatives of a motion, with scipy's as judge, and what was lost of the force."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import savgol_filter

from rig.diagnosis.observations import (
    derivative,
    far_readings,
    jitter_mm,
    lost_times,
    observe,
    sound_trials,
    working_period,
)
from rig.diagnosis.run import diagnose_session
from rig.trials.trial import Trial, TrialSet
from tests.rig.diagnosis.made_tissue import MadeTissue


@pytest.mark.parametrize(("count", "order"), [(5, 1), (9, 1), (17, 2), (161, 2)])
def test_derivatives_are_those_of_savitzky_and_golay(count: int, order: int) -> None:
    values = np.cumsum(np.random.default_rng(1).standard_normal(400))
    expected = savgol_filter(values, count, 4, deriv=order, delta=1e-3)
    assert derivative(values, count, order, 1e-3) == pytest.approx(expected, abs=1e-7 * float(np.abs(expected).max()))


def slow_force_N(time_s: np.ndarray) -> np.ndarray:
    return np.sin(2 * np.pi * 0.8 * time_s)


def with_lost_force(lost: slice | list[int]) -> TrialSet:
    """Ten seconds at 100 Hz; of force some samples are lost."""
    time_s = np.arange(0, 10, 0.01)
    kept = np.delete(time_s, lost)
    trial = Trial("one", kept, slow_force_N(kept), time_s, 20 + 3 * np.sin(2 * np.pi * 0.8 * time_s))
    return TrialSet("made", (trial,))


@pytest.mark.parametrize("lost", [slice(0, 0), [57, 200, 201, 640], slice(300, 306)])
def test_a_delay_is_one_of_time_where_samples_of_force_were_lost(lost: slice | list[int]) -> None:
    """As rows of a grid with breaks, eight samples behind a break of six would be fourteen: off by 0.3 N."""
    drive = observe(with_lost_force(lost)).drive
    early = drive.shifted(slow_force_N(drive.time_s), 0.0812)
    inner = slice(10, -10)
    assert early[inner] == pytest.approx(slow_force_N(drive.time_s - 0.0812)[inner], abs=1e-4)


def test_lost_samples_are_rows_that_are_not_judged_with_the_motion_that_was_measured() -> None:
    seen = observe(with_lost_force([57, 200, 201, 640]))
    assert seen.drive.time_s == pytest.approx(np.arange(0, 10, 0.01))
    assert seen.unseen is not None
    assert np.flatnonzero(seen.unseen).tolist() == [57, 200, 201, 640]
    assert seen.drive.position_mm == pytest.approx(20 + 3 * np.sin(2 * np.pi * 0.8 * seen.drive.time_s), abs=1e-4)


def test_breaks_are_filled_evenly_whatever_is_left_between_them_and_long_ones_are_breaks() -> None:
    assert lost_times(np.array([0.0, 0.01, 0.0205, 0.05]), 0.01) == pytest.approx([0.0303333, 0.0401667], abs=1e-6)
    assert not lost_times(np.array([0.0, 0.0149, 0.02, 6.0]), 0.01).size


@pytest.mark.parametrize(("told", "expected_mm"), [(True, 0.0005 / np.sqrt(12)), (False, 20 * 5e-5)])
def test_only_stamps_that_are_not_told_make_a_motion_rough(told: bool, expected_mm: float) -> None:
    """At 20 mm/s, read 50 us early or late: with true stamps what is left is the rounding of an encoder of 0.5 um."""
    rng, even_s = np.random.default_rng(4), np.arange(0, 1, 1e-3)
    read_s = even_s + rng.normal(0, 5e-5, len(even_s))
    place_mm = np.round(20 * read_s / 0.0005) * 0.0005
    trial = Trial("one", even_s, even_s, read_s if told else even_s, place_mm)
    assert jitter_mm(trial) == pytest.approx(expected_mm, rel=0.15)


def test_a_single_reading_far_out_is_told_from_a_touch_a_turn_and_a_step_of_the_converter() -> None:
    rng = np.random.default_rng(0)
    way_mm = np.concatenate([np.zeros(200), np.linspace(0.0, 6.0, 200), np.linspace(6.0, 0.0, 100)])
    force_N = 0.5 * way_mm + rng.normal(0.0, 0.004, len(way_mm))  # kinks of 0.015 and 0.045 N where it turns
    assert not far_readings(force_N).any()
    spiked = force_N.copy()
    spiked[[50, 300]] += (0.1, -0.15)
    assert np.flatnonzero(far_readings(spiked)).tolist() == [50, 300]
    # Rest on one step of a converter, and its least significant digit now and then.
    assert not far_readings(0.02 * rng.binomial(1, 0.05, 500).astype(np.float64)).any()
    assert not far_readings(np.repeat([0.0, 1.0], 250) + rng.normal(0.0, 0.004, 500)).any()
    # Of a few readings, as of a slow machine, the top of a stroke is one.
    assert not far_readings(np.concatenate([force_N[:30], [0.5], force_N[31:60]])).any()


def test_readings_far_out_are_named_and_not_judged() -> None:
    made = MadeTissue().session()
    force_N = made.trials[0].force_N.copy()
    force_N[[100, 400]] += 0.2
    found = observe(replace(made, trials=(replace(made.trials[0], force_N=force_N), *made.trials[1:])))
    (said,) = (finding for finding in found.findings if "far from both" in finding.text)
    assert said.text.startswith("2 readings") and said.recording == "stroke_0"
    clean = observe(made)
    assert found.unseen is not None and clean.unseen is not None
    assert np.count_nonzero(found.unseen) == np.count_nonzero(clean.unseen) + 2


@pytest.mark.parametrize(("rate_Hz", "expected_Hz"), [(1000, 100), (250, 125), (99.9, 99.9), (50, 25), (10, 10)])
def test_of_long_sessions_only_those_that_show_nothing_fast_are_thinned_below_100_Hz(
    rate_Hz: float, expected_Hz: float
) -> None:
    """Forty minutes at 25 Hz are the 60,000 samples that a long session is thinned to."""
    time_s = np.arange(0, 2400, 1 / rate_Hz)
    assert 1 / working_period([Trial("long", time_s, time_s, time_s, time_s)]) == pytest.approx(expected_Hz, rel=1e-3)


def test_a_coarse_converter_is_seen_by_its_steps_and_a_right_simulation_left_right() -> None:
    """Steps of 20 mN: in the air the reading rests on one of them, and its noise of 4 mN hardly shows."""
    made = MadeTissue().session()
    coarse = replace(made, trials=tuple(replace(t, force_N=np.round(t.force_N / 0.02) * 0.02) for t in made.trials))
    assert observe(coarse).step_N == pytest.approx(0.02)
    found = diagnose_session(coarse)
    assert (found.verdict, found.findings) == ("adequate", ())


def pressed(stiffness: float, seed: int, hold_s: float = 0.5) -> Trial:
    """0.3 s into 6 mm at 100 Hz, of which the last 4 are tissue, and a hold; noise of 5 mN."""
    time_s = 10.0 * seed + np.arange(0, 0.3 + hold_s, 0.01)
    axis_mm = np.minimum(20 * (time_s - time_s[0]), 6.0)
    noise_N = np.random.default_rng(seed).normal(0, 0.005, len(time_s))
    return Trial(f"trial {seed}", time_s, stiffness * np.maximum(axis_mm - 2, 0) + noise_N, time_s, axis_mm)


@pytest.mark.parametrize(
    ("stiffness", "kinds"),
    [
        ((1.0, 1.0, 0.0, 0.0, 0.0, 0.0), "--cccc"),  # most wells are empty, and half of these seem to fall
        ((1.0, 1.0, 1.0, 1.0, 0.0, -1.0), "----cs"),
        ((1.0, 1.0, 1.0, 1.0, 1.0, 0.004), "-----c"),  # 16 mN of contact beside 4 N
        ((0.02, 0.02, 0.02, 0.006, 0.006, 0.006), "------"),  # light, all of them
        ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0), "------"),  # said of the session as a whole
    ],
)
def test_what_does_not_rise_beside_what_does_is_told_by_its_reason(stiffness: tuple[float, ...], kinds: str) -> None:
    trials = tuple(pressed(newton, seed) for seed, newton in enumerate(stiffness))
    kept, lost = sound_trials(TrialSet("made", trials))
    assert [trial.name for trial in kept] == [t.name for t, kind in zip(trials, kinds, strict=True) if kind == "-"]
    told = {"c": "no contact", "s": "sign"}
    expected = {t.name: told[kind] for t, kind in zip(trials, kinds, strict=True) if kind != "-"}
    assert {finding.recording: finding.kind for finding in lost} == expected


def test_neither_a_long_hold_nor_one_alone_is_a_recording_without_contact() -> None:
    held = pressed(1.0, 3, hold_s=20.0)
    still = replace(
        held, name="still", axis_mm=np.full(len(held.axis_mm), 6.0), force_N=held.force_N.max() + 0 * held.force_N
    )
    trials = (pressed(1.0, 0), pressed(1.0, 1), pressed(1.0, 2), held, still)
    assert len(sound_trials(TrialSet("made", trials))[0]) == 5
