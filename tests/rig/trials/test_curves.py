"""From raw samples to a loading curve: zero, contact, steady part; and every trial that has none."""

from dataclasses import replace

import numpy as np
import pytest

from mock_devices.testing.made.preloaded import SENSORS, preloaded
from mock_devices.testing.made.synthetic import SPEEDS_MM_S, Bench, index_force, recording, tables, with_friction
from rig.errors import DataError
from rig.trials.contact import find_contact
from rig.trials.curves import loading_curve
from rig.trials.cycles import IndentationCycle, cycle_of
from rig.trials.recorded import trial_of


@pytest.mark.parametrize("speed_mm_s", SPEEDS_MM_S)
@pytest.mark.parametrize("damping_N_s_mm", [0.0, 0.01])
def test_the_true_surface_lies_in_the_interval_of_contact(speed_mm_s: float, damping_N_s_mm: float) -> None:
    bench = Bench(force=index_force(a_N_mm=0.3, b_per_mm=0.15, damping_N_s_mm=damping_N_s_mm))
    curve = loading_curve(bench.cycle(speed_mm_s))
    assert curve.contact.lower_mm <= bench.surface_mm <= curve.contact.upper_mm
    assert abs(curve.contact.position_mm - bench.surface_mm) < 0.15


def test_a_curve_spans_from_the_air_to_the_deepest_steady_point() -> None:
    curve = loading_curve(Bench().cycle(10.0))
    assert curve.depth_mm[0] == pytest.approx(-0.5, abs=0.05)
    assert 7.7 < curve.max_depth_mm < 8.1
    assert curve.rate_mm_s[curve.depth_mm > 0] == pytest.approx(10.0, rel=0.02)
    assert curve.zero_N == pytest.approx(0.7, abs=0.002)
    assert curve.noise_N == pytest.approx(0.01, rel=0.2)


def test_speed_is_found_where_nobody_said_it() -> None:
    assert loading_curve(Bench().cycle(15.0, nominal=False)).speed_mm_s == pytest.approx(15.0)


@pytest.mark.parametrize("speed_mm_s", SPEEDS_MM_S)
@pytest.mark.parametrize("level_N", [0.05, 0.1, 0.3])
def test_a_guide_that_rubs_moves_the_zero_and_neither_contact_nor_curve(speed_mm_s: float, level_N: float) -> None:
    smooth = loading_curve(Bench().cycle(speed_mm_s))
    with_guide = loading_curve(Bench(force=with_friction(level_N)).cycle(speed_mm_s))
    assert with_guide.zero_N == pytest.approx(0.7 + level_N, abs=0.004)
    assert with_guide.contact.lower_mm <= Bench().surface_mm <= with_guide.contact.upper_mm
    at_mm = np.linspace(19.8, 27.5, 100)
    forces = [np.interp(at_mm, c.depth_mm + c.contact.position_mm, c.force_N) for c in (smooth, with_guide)]
    assert np.abs(forces[0] - forces[1]).max() < 0.015


def test_holds_dither_and_a_second_depth_are_no_part_of_the_curve() -> None:
    plain = loading_curve(Bench().cycle(10.0))
    busy = loading_curve(Bench(dither_mm=0.3, second_depth_mm=10.0).cycle(10.0))
    assert busy.max_depth_mm == pytest.approx(plain.max_depth_mm, abs=0.1)
    assert len(busy.depth_mm) == pytest.approx(len(plain.depth_mm), abs=15)


def test_a_wrong_single_sample_is_neither_contact_nor_peak() -> None:
    cycle = Bench().cycle(10.0)
    force = cycle.force_N.copy()
    middle = int(np.argmax(force)) - 300
    force[200], force[middle], force[-50] = 9.0, 0.0, 50.0
    spiked, clean = loading_curve(replace(cycle, force_N=force)), loading_curve(cycle)
    assert spiked.contact.position_mm == pytest.approx(clean.contact.position_mm, abs=0.05)
    assert spiked.max_depth_mm == pytest.approx(clean.max_depth_mm, abs=0.05)


@pytest.mark.parametrize("rate_Hz", [1000.0, 100.0, 25.0, 10.0])
def test_sparse_samples_give_a_wider_interval_that_still_holds_the_surface(rate_Hz: float) -> None:
    curve = loading_curve(Bench(rate_Hz=rate_Hz, axis_rate_Hz=50.0).cycle(5.0))
    lower_mm, upper_mm = curve.contact.lower_mm, curve.contact.upper_mm
    assert lower_mm <= 20.0 <= upper_mm
    assert upper_mm - lower_mm < 0.2 + 4 * 5.0 / rate_Hz


@pytest.mark.parametrize("clock_s", [-0.05, 0.05])
def test_a_clock_offset_moves_contact_and_leaves_the_shape(clock_s: float) -> None:
    straight, shifted = (loading_curve(Bench(clock_s=clock).cycle(20.0)) for clock in (0.0, clock_s))
    assert shifted.contact.position_mm - straight.contact.position_mm == pytest.approx(20 * clock_s, abs=0.1)
    for force_N in (1.0, 2.0, 4.0):
        depths = [float(np.interp(force_N, np.maximum.accumulate(c.force_N), c.depth_mm)) for c in (straight, shifted)]
        assert depths[0] == pytest.approx(depths[1], abs=0.1)


def test_no_flat_end_remains_where_force_stops_before_the_tip_does() -> None:
    curve = loading_curve(Bench(clock_s=-0.05).cycle(20.0))
    assert curve.force_N[-1] > 0.98 * curve.max_force_N
    assert np.count_nonzero(curve.force_N > 0.98 * curve.max_force_N) < 15


def test_contact_of_a_noiseless_jump_is_where_it_jumps() -> None:
    position = np.linspace(8.0, 12.0, 401)
    force = np.where(position >= 10.0, 0.3 + 0.2 * (position - 10.0), 0.0)
    found = find_contact(position, force, (8.5, 10.1), noise_N=1e-4)
    assert found.position_mm == pytest.approx(10.0, abs=0.02)
    assert found.lower_mm < 10.0 < found.upper_mm


def moved(cycle: IndentationCycle, start: int) -> IndentationCycle:
    """The cycle from a sample on."""
    return replace(
        cycle, time_s=cycle.time_s[start:], force_N=cycle.force_N[start:], position_mm=cycle.position_mm[start:]
    )


def test_a_stroke_in_the_air_has_no_contact() -> None:
    cycle = Bench(force=index_force(a_N_mm=1e-6, damping_N_s_mm=0.0)).cycle(10.0)
    with pytest.raises(DataError, match=r"trial_000: no contact: force rises by .* N at most .* go deeper"):
        loading_curve(cycle)


def test_force_of_the_wrong_sign_names_the_settings_that_turn_it() -> None:
    cycle = Bench().cycle(10.0)
    with pytest.raises(DataError, match=r"sign of compression is wrong; correct force.compression .* in the mapping"):
        loading_curve(replace(cycle, force_N=-cycle.force_N))


@pytest.mark.parametrize("noise_N", [0.005, 0.05])
@pytest.mark.parametrize(("a_N_mm", "b_per_mm"), [(0.02, 0.5), (0.12, 0.22), (1.0, 0.0)])
def test_gentle_and_hard_tissue_and_a_noisy_sensor_have_an_air_part(
    a_N_mm: float, b_per_mm: float, noise_N: float
) -> None:
    bench = Bench(force=index_force(a_N_mm, b_per_mm, 0.005), noise_N=noise_N)
    for speed_mm_s in SPEEDS_MM_S:
        contact = loading_curve(bench.cycle(speed_mm_s)).contact
        assert contact.lower_mm - 0.1 <= 20.0 <= contact.upper_mm + 0.1


def test_a_stated_speed_that_is_not_the_motions_is_not_used() -> None:
    cycle = Bench().cycle(5.0)
    right, wrong = (loading_curve(replace(cycle, speed_mm_s=speed_mm_s)) for speed_mm_s in (5.0, 50.0))
    assert wrong.speed_mm_s == 5.0
    assert wrong.force_N == pytest.approx(right.force_N)


def pulled_out(cycle: IndentationCycle) -> IndentationCycle:
    """The cycle as a machine records it that counts tension and the way out as negative."""
    return replace(cycle, force_N=-cycle.force_N, position_mm=-cycle.position_mm)


def test_tension_is_loading_in_its_own_sense() -> None:
    cycle = preloaded("linear", SENSORS["bota"], 0)
    pushed, pulled = loading_curve(cycle), loading_curve(pulled_out(cycle))
    assert pulled.findings[0].kind == "tension"
    assert not [finding for finding in pushed.findings if finding.kind == "tension"]
    assert pulled.depth_mm == pytest.approx(pushed.depth_mm)
    assert pulled.force_N == pytest.approx(pushed.force_N)


def test_a_tip_that_leaves_the_tissue_is_no_tension() -> None:
    cycle = Bench(zero_N=0.0, noise_N=0.002).cycle(10.0)
    with pytest.raises(DataError, match="started in contact"):
        loading_curve(moved(cycle, int(np.flatnonzero(cycle.position_mm > 27.9)[-1])))


def test_a_tip_that_steps_is_read_where_it_goes_on() -> None:
    bench = Bench(noise_N=0.002)
    cycle = bench.cycle(10.0)
    inside = (cycle.position_mm > 18.5) & (np.arange(len(cycle.time_s)) <= int(np.argmax(cycle.position_mm)))
    steps_mm = np.where(inside, np.floor(cycle.position_mm), cycle.position_mm)
    forces = [bench.force(steps_mm - bench.surface_mm, np.zeros_like(steps_mm)), cycle.force_N * 0 + 0.7]
    curve = loading_curve(replace(cycle, position_mm=steps_mm, force_N=np.sum(forces, axis=0), speed_mm_s=np.nan))
    assert "unsteadily" in curve.findings[-1].text
    expected_N = bench.force(curve.depth_mm + curve.contact.position_mm - 20.0, np.zeros_like(curve.depth_mm))
    assert curve.force_N == pytest.approx(expected_N, abs=0.01)
    assert curve.max_depth_mm > 7


def test_few_samples_in_the_rise_leave_the_surface_open_and_are_refused() -> None:
    cycle = Bench(depth_mm=4.0, rate_Hz=15.0, axis_rate_Hz=100.0).cycle(30.0)
    with pytest.raises(DataError, match=r"its surface lies between .* \(at most a quarter is allowed\); record faster"):
        loading_curve(cycle)


def test_two_samples_are_no_trial() -> None:
    with pytest.raises(DataError, match=r"trial_000: 2 samples; a curve needs at least 3"):
        loading_curve(moved(Bench().cycle(5.0), -2))


@pytest.mark.parametrize("nominal", [True, False])
def test_a_tip_that_stands_while_force_rises_has_no_loading(nominal: bool) -> None:
    cycle = Bench().cycle(10.0, nominal=nominal)
    still = replace(cycle, position_mm=np.minimum(cycle.position_mm, 18.0))
    with pytest.raises(
        DataError, match=r"no loading: force rises while the tip does not go deeper; check axis and clocks"
    ):
        loading_curve(still)


# From a recording


def test_compression_is_positive_whatever_sign_and_axis_the_sensor_has() -> None:
    cycle = Bench().cycle(10.0)
    made = recording(cycle)
    aligned = cycle_of(trial_of("trial", made))
    assert aligned.force_N == pytest.approx(cycle.force_N)
    assert aligned.position_mm == pytest.approx(cycle.position_mm, abs=1e-9)
    assert aligned.speed_mm_s == 10.0
    made.tables["force"]["fx_N"] = 3.0 * cycle.force_N
    made.metadata["calibration"] = {"force_axis": "fx", "compression": "positive"}
    assert cycle_of(trial_of("trial", made)).force_N == pytest.approx(3.0 * cycle.force_N)


def test_position_is_taken_at_the_capture_time_of_force() -> None:
    made = recording(Bench().cycle(10.0))
    made.tables["axis"] = made.tables["axis"][::7]
    made.tables["axis"]["arrival_ns"] += 5_000_000
    aligned, cycle = cycle_of(trial_of("trial", made)), Bench().cycle(10.0)
    assert aligned.position_mm == pytest.approx(cycle.position_mm[: len(aligned.position_mm)], abs=0.05)


def test_samples_the_device_does_not_vouch_for_are_left_out() -> None:
    made = recording(Bench().cycle(10.0))
    made.tables["force"]["fz_N"][100:120] = np.nan
    made.tables["force"]["valid"][100:120] = 0
    assert np.all(np.isfinite(cycle_of(trial_of("trial", made)).force_N))


def test_samples_that_hold_no_number_are_left_out() -> None:
    made = recording(Bench().cycle(10.0))
    whole = cycle_of(trial_of("trial", made))
    made.tables["force"]["fz_N"][100:102], made.tables["axis"]["position_mm"][50] = np.nan, np.inf
    kept = np.delete(np.arange(len(whole.time_s)), [100, 101])
    spoilt = cycle_of(trial_of("trial", made))
    np.testing.assert_array_equal(spoilt.time_s, whole.time_s[kept])
    np.testing.assert_array_equal(spoilt.force_N, whole.force_N[kept])
    assert spoilt.position_mm == pytest.approx(whole.position_mm[kept], abs=0.01)


def test_positions_that_came_late_are_left_out() -> None:
    made = recording(Bench().cycle(10.0))
    whole = cycle_of(trial_of("trial", made))
    made.tables["axis"]["arrival_ns"][1000:1004] += 3_000_000
    made.tables["axis"]["position_mm"][1000:1004] += 0.3
    assert cycle_of(trial_of("trial", made)).position_mm == pytest.approx(whole.position_mm, abs=0.02)


def test_a_stream_without_a_valid_sample_is_named() -> None:
    made = recording(Bench().cycle(10.0))
    made.tables["force"]["valid"] = 0
    with pytest.raises(DataError, match=r"trial: no valid force samples; a trial needs force and axis"):
        cycle_of(trial_of("trial", made))


def test_samples_whose_time_goes_back_are_left_out() -> None:
    made = recording(Bench().cycle(10.0))
    whole = cycle_of(trial_of("trial", made))
    made.tables["force"]["capture_ns"][50] -= 10_000_000
    np.testing.assert_array_equal(cycle_of(trial_of("trial", made)).time_s, np.delete(whole.time_s, 50))


def test_streams_of_different_times_do_not_overlap() -> None:
    cycle = Bench().cycle(10.0)
    made = recording(cycle)
    made.tables.update(axis=tables(cycle)["axis"])
    made.tables["axis"]["capture_ns"] += 3_600_000_000_000
    with pytest.raises(DataError, match=r"have no common time; check the clocks"):
        cycle_of(trial_of("trial", made))


@pytest.mark.parametrize(
    ("section", "key", "value", "says"),
    [
        ("calibration", "force_axis", "fw", "force_axis is 'fw'; it must be fx, fy or fz"),
        ("calibration", "compression", "both", "compression is 'both'; it must be positive or negative"),
        ("trial", "speed_mm_s", "fast", "speed_mm_s is 'fast'; it must be a number"),
    ],
)
def test_metadata_that_say_nothing_usable_are_refused(section: str, key: str, value: str, says: str) -> None:
    made = recording(Bench().cycle(10.0))
    made.metadata[section][key] = value
    with pytest.raises(DataError, match=says):
        cycle_of(trial_of("trial", made))
