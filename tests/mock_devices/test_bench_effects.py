import math

import numpy as np
import pytest

from mock_devices.bench import Bench
from mock_devices.parameters import Parameters
from mock_devices.physics.effects import EFFECTS, complete, knobs, parse_hidden, statement
from rig.errors import UsageError
from tests.mock_devices.playing import MS_NS, QUIET, SURFACE_MM, crossing, play, quiet_bench, settle, stroke

NAMES = [
    *("relaxation", "rate_law", "friction", "backlash", "frame_compliance", "contact_offset", "substrate"),
    *("zero_drift", "gain_error", "time_offset", "tracker_latency", "filter_lag", "surface_motion", "preconditioning"),
    *("adhesion", "tip_inertia", "position_ripple", "temperature", "elastic_law"),
    *("second_relaxation", "third_relaxation", "power_law_relaxation", "hunt_crossley", "mullins"),
    *("sensor_hysteresis", "clock_drift", "surface_motion_harmonic", "cogging", "cross_talk"),
]
DIMENSIONLESS = {"ratio", "exponent", "strength", "gain", "softening", "cycles", "weight", "fung_share"}


def test_the_library_has_exactly_the_agreed_names() -> None:
    assert sorted(EFFECTS) == sorted(NAMES)


@pytest.mark.parametrize("effect", NAMES)
def test_every_parameter_carries_its_unit_and_its_default_lies_within_its_bounds(effect: str) -> None:
    units = ("_N", "_mm", "_s", "_Hz", "_rad", "_kg", "_C", "_mm_N", "_N_h", "_per_K", "_per_mm", "_s_mm", "_ppm")
    assert statement(effect)
    for name, knob in knobs(effect).items():
        assert name.endswith(units) or name in DIMENSIONLESS
        assert knob.low <= knob.default <= knob.high
        assert knob.meaning


@pytest.mark.parametrize("effect", NAMES)
def test_an_effect_at_its_defaults_changes_what_is_seen_and_switched_off_it_leaves_no_trace(effect: str) -> None:
    def seen(bench: Bench) -> list[object]:
        traces = [play(bench, stroke(30.0, 8.0, hold_s=0.1, start_mm=15.0), 1.0) for _ in range(2)]
        forces = [trace.force_N.tolist() for trace in traces]
        return [forces, bench.axis.position_mm, bench.tip_mm, bench.tracker.markers(bench.now_ns - 400 * MS_NS)]

    clean, hidden, switched_off = quiet_bench(), quiet_bench({effect: {}}), quiet_bench({effect: {}})
    switched_off.hide({})
    reference = seen(clean)
    assert seen(hidden) != reference
    assert seen(switched_off) == reference


def test_relaxation_lets_the_force_decay_in_a_hold_with_its_time_constant() -> None:
    bench = quiet_bench({"relaxation": {"ratio": 0.3, "time_constant_s": 0.4}})
    trace = play(bench, stroke(30.0, 8.0, hold_s=5.0), 3.5)
    extra_N = trace.force_N - trace.force_N[-1]
    assert extra_N[trace.at(0.9)] > 0.4
    assert extra_N[trace.at(1.4)] / extra_N[trace.at(1.0)] == pytest.approx(math.exp(-1), rel=0.02)


def test_rate_law_makes_the_force_grow_with_a_power_of_the_speed() -> None:
    def viscous_N(speed_mm_s: float) -> float:
        bench = quiet_bench({"rate_law": {"exponent": 0.5, "level_N": 0.4}})
        trace = play(bench, stroke(speed_mm_s, 8.0), 9.0 / speed_mm_s)
        return float(trace.force_N[-1]) - bench.tissue.elastic_N(float(trace.tip_mm[-1]) - SURFACE_MM)

    assert viscous_N(10.0) == pytest.approx(0.4, abs=0.005)
    assert viscous_N(30.0) == pytest.approx(0.4 * math.sqrt(3), abs=0.01)


def test_friction_of_the_guide_is_felt_in_the_air_and_turns_round_over_its_slip_length() -> None:
    bench = quiet_bench({"friction": {"level_N": 0.2, "slip_length_mm": 0.1}})
    trace = play(bench, lambda t: 5 + 10 * min(t, 1 - t), 1.0)
    assert trace.force_N[trace.at(0.4)] == pytest.approx(0.2, abs=1e-4)
    assert trace.force_N[-1] == pytest.approx(-0.2, abs=1e-4)
    turned = int(np.argmax(trace.tip_mm))
    back_mm = trace.tip_mm[turned] - trace.tip_mm[turned:]
    half = turned + crossing(back_mm, 0.1 * math.log(2))
    assert trace.force_N[half] == pytest.approx(0.0, abs=0.02)


def test_backlash_leaves_the_tip_behind_by_half_the_gap_on_either_side() -> None:
    bench = quiet_bench({"backlash": {"gap_mm": 0.4}})
    trace = play(bench, lambda t: 5 + 10 * min(t, 1 - t), 1.0)
    assert trace.tip_mm[trace.at(0.4)] - trace.axis_mm[trace.at(0.4)] == pytest.approx(-0.2)
    assert trace.tip_mm[-1] - trace.axis_mm[-1] == pytest.approx(0.2)
    turned = int(np.argmax(trace.axis_mm))
    still = trace.tip_mm[turned : turned + crossing(trace.axis_mm[turned] - trace.axis_mm[turned:], 0.39)]
    assert np.ptp(still) == pytest.approx(0, abs=1e-3)


def test_compliant_frame_bends_in_proportion_to_the_force_and_only_in_contact() -> None:
    bench = quiet_bench({"frame_compliance": {"compliance_mm_N": 0.1}})
    trace = settle(bench, SURFACE_MM + 8, 3.0)
    assert trace.axis_mm[100] - trace.tip_mm[100] == 0
    assert trace.axis_mm[-1] - trace.tip_mm[-1] == pytest.approx(0.1 * trace.force_N[-1], abs=1e-4)
    assert trace.force_N[-1] > 3


@pytest.mark.parametrize("compliance_mm_N", [0.001, 0.01, 0.5])
def test_compliant_frame_stays_calm_between_its_bounds(compliance_mm_N: float) -> None:
    bench = quiet_bench({"frame_compliance": {"compliance_mm_N": compliance_mm_N}, "rate_law": {"level_N": 1.0}})
    trace = settle(bench, SURFACE_MM + 10, 3.0)
    assert np.ptp(trace.force_N[-200:]) < 0.02


def test_contact_offset_has_the_tip_touch_later_than_stated() -> None:
    trace = play(quiet_bench({"contact_offset": {"offset_mm": 0.5}}), stroke(10.0, 5.0), 1.0)
    touched = crossing(trace.contact_N, 1e-9)
    assert trace.tip_mm[touched] == pytest.approx(SURFACE_MM + 0.5, abs=0.02)


def test_contact_offset_can_scatter_from_contact_to_contact() -> None:
    bench = quiet_bench({"contact_offset": {"offset_mm": 0.0, "scatter_mm": 0.2}})
    surfaces_mm = []
    for _ in range(200):
        surfaces_mm.append(bench.limb.position_mm)
        bench.limb.wanted_mm = bench.tip_mm - 2
        bench.advance(bench.now_ns + 1000 * MS_NS)
        bench.limb.wanted_mm = SURFACE_MM
        bench.advance(bench.now_ns + 1000 * MS_NS)
    assert len(set(surfaces_mm)) > 150
    assert np.std(surfaces_mm) == pytest.approx(0.2, rel=0.1)


def test_substrate_stiffens_with_the_cube_of_the_depth() -> None:
    bench = quiet_bench({"substrate": {"strength": 1.0, "thickness_mm": 16.0}})
    settle(bench, SURFACE_MM + 8, 3.0)
    assert bench.contact_N == pytest.approx(bench.tissue.elastic_N(8.0) * 1.125, abs=2e-3)


def test_zero_drift_shows_in_the_air_with_the_time_of_the_session() -> None:
    bench = quiet_bench({"zero_drift": {"rate_N_h": 36.0}})
    trace = play(bench, lambda _: 5.0, 2.0)
    assert trace.force_N[-1] == pytest.approx(36.0 / 3600 * 2.0, abs=1e-6)


def test_gain_error_scales_the_force_read_and_not_the_force_there_is() -> None:
    bench = quiet_bench({"gain_error": {"gain": 0.1}})
    trace = settle(bench, SURFACE_MM + 8, 3.0)
    assert trace.force_N[-1] == pytest.approx(1.1 * bench.tissue.elastic_N(8.0), abs=2e-3)
    assert trace.contact_N[-1] == pytest.approx(bench.tissue.elastic_N(8.0), abs=2e-3)


def test_time_offset_has_the_force_come_late_against_the_position() -> None:
    trace = play(quiet_bench({"time_offset": {"delay_s": 0.02}}), stroke(20.0, 8.0), 0.6)
    assert trace.force_N[20:] == pytest.approx(trace.contact_N[:-20], abs=1e-9)
    assert trace.force_N[-1] < trace.contact_N[-1]


def test_filter_lag_answers_a_jump_with_63_percent_after_its_time_constant() -> None:
    bench = quiet_bench({"filter_lag": {"time_constant_s": 0.05}})
    settle(bench, SURFACE_MM + 8, 3.0)
    before_N = bench.force.zero[2] - bench.force.wrench()[2]
    bench.tissue.present = False
    bench.advance(bench.now_ns + 50 * MS_NS)
    after_N = bench.force.zero[2] - bench.force.wrench()[2]
    assert after_N / before_N == pytest.approx(math.exp(-1), rel=0.02)


def test_tracker_latency_has_the_marker_trail_the_tip() -> None:
    def z_mm(hide: dict[str, dict[str, float]]) -> float:
        bench = quiet_bench(hide, tracker={"noise_mm": 0, "direction": (0, 0, 1)})
        play(bench, lambda t: 5 + 20 * t, 0.5)
        tip = bench.tracker.markers(bench.now_ns)[0]
        assert tip
        return tip.z_mm

    trailing_mm = z_mm({}) - z_mm({"tracker_latency": {"delay_s": 0.05}})
    assert trailing_mm == pytest.approx(20 * 0.05, rel=0.02)


def test_surface_motion_breathes_under_a_tip_at_rest() -> None:
    bench = quiet_bench({"surface_motion": {"amplitude_mm": 0.5, "frequency_Hz": 0.5}})
    settle(bench, SURFACE_MM + 5, 2.0)
    start_s = bench.time_s
    trace = play(bench, lambda _: SURFACE_MM + 5, 4.0)
    slope_N_mm = bench.tissue.elastic_N(5.01) * 100 - bench.tissue.elastic_N(5.0) * 100
    wave = np.exp(-1j * math.tau * 0.5 * (trace.time_s - start_s))
    assert 2 * abs(np.mean(trace.force_N * wave)) == pytest.approx(0.5 * slope_N_mm, rel=0.1)


def test_preconditioning_softens_from_stroke_to_stroke_and_rest_brings_stiffness_back() -> None:
    bench = quiet_bench({"preconditioning": {"softening": 0.3, "cycles": 1.0, "recovery_s": 20.0}})

    def peak_N() -> float:
        return float(play(bench, stroke(30.0, 8.0), 1.5).force_N.max())

    first, second, third = peak_N(), peak_N(), peak_N()
    assert second / first == pytest.approx(1 + 0.3 * math.expm1(-math.exp(-0.7 / 20)), abs=0.01)
    assert third < second
    bench.advance(bench.now_ns + 120_000 * MS_NS)
    assert peak_N() == pytest.approx(first, rel=0.01)


def test_adhesion_pulls_only_while_the_tip_leaves() -> None:
    bench = quiet_bench({"adhesion": {"level_N": 0.3, "length_mm": 0.5}})
    trace = play(bench, stroke(10.0, 5.0), 2.5)
    deepest = int(np.argmax(trace.tip_mm))
    assert trace.force_N[:deepest].min() >= 0
    leaving = deepest + int(np.argmin(trace.force_N[deepest:]))
    assert trace.force_N[leaving] == pytest.approx(-0.3, abs=0.02)
    assert trace.tip_mm[leaving] == pytest.approx(SURFACE_MM, abs=0.1)
    assert trace.force_N[-1] == 0


def test_tip_inertia_is_felt_in_the_air_as_mass_times_acceleration() -> None:
    bench = quiet_bench({"tip_inertia": {"mass_kg": 0.2}})
    trace = play(bench, lambda t: 5 + 0.5 * math.sin(math.tau * 5 * t), 1.4)
    wave = np.exp(-1j * math.tau * 5 * trace.time_s[400:])
    force_N, swing_mm = np.mean(trace.force_N[400:] * wave), np.mean((trace.axis_mm[400:] - 5) * wave)
    assert force_N / swing_mm == pytest.approx(-0.2e-3 * (math.tau * 5) ** 2, rel=0.03)


def test_magnets_pull_in_the_air_and_again_after_their_pitch() -> None:
    bench = quiet_bench({"cogging": {"level_N": 0.1, "period_mm": 4.0}})
    trace = play(bench, lambda t: 5 + 8 * min(t, 1.0), 1.5)
    from_start = trace.tip_mm - trace.tip_mm[0]
    turn = math.tau * from_start / 4.0
    expected_N = 0.1 * (np.sin(turn) + 0.3 * np.sin(2 * turn + 1))
    assert trace.force_N[10:] - trace.force_N[10] == pytest.approx(expected_N[10:] - expected_N[10], abs=0.01)
    assert np.ptp(trace.force_N) > 0.15


def test_a_cable_pulls_with_the_square_of_the_way() -> None:
    bench = quiet_bench({"cross_talk": {"level_N": 0.2}})
    trace = play(bench, lambda t: 5 + 8 * min(t, 1.0), 1.5)
    slope = np.polynomial.Polynomial.fit(trace.tip_mm[10:], trace.force_N[10:], 2).convert().coef
    assert slope[2] == pytest.approx(0.2 / 100, rel=0.02)


def test_position_ripple_repeats_with_the_lead_of_the_screw() -> None:
    bench = quiet_bench({"position_ripple": {"amplitude_mm": 0.05, "period_mm": 4.0, "phase_rad": 0.0}})
    for position_mm in (9.0, 13.0, 11.0):
        trace = settle(bench, position_mm, 2.0)
        expected_mm = 0.05 * math.sin(math.tau * position_mm / 4.0)
        assert trace.tip_mm[-1] - trace.axis_mm[-1] == pytest.approx(expected_mm, abs=1e-4)


def test_temperature_changes_the_gain_as_the_sensor_warms_up() -> None:
    warming = QUIET.model_copy(update={"warm_up_K": 10.0, "warm_up_s": 0.5})
    bench = quiet_bench({"temperature": {"gain_per_K": 0.01, "reference_C": 25.0}}, force=warming)
    trace = settle(bench, SURFACE_MM + 8, 5.0)
    assert trace.force_N[-1] / trace.contact_N[-1] == pytest.approx(1.10, abs=1e-3)


@pytest.mark.parametrize(
    ("parameters", "half_over_full"),
    [
        ({"exponent": 2.0}, 0.25),
        ({"exponent": 1.0}, 0.5),
        ({"fung_share": 1.0, "fung_per_mm": 0.3}, math.expm1(1.2) / math.expm1(2.4)),
    ],
)
def test_elastic_law_has_another_shape_but_the_same_force_where_it_is_matched(
    parameters: dict[str, float], half_over_full: float
) -> None:
    bench = quiet_bench({"elastic_law": parameters | {"match_depth_mm": 8.0}})
    settle(bench, SURFACE_MM + 4, 3.0)
    half_N = bench.contact_N
    settle(bench, SURFACE_MM + 8, 3.0)
    assert bench.contact_N == pytest.approx(bench.tissue.elastic_N(8.0), abs=2e-3)
    assert half_N / bench.contact_N == pytest.approx(half_over_full, abs=1e-3)


def test_power_law_relaxation_fades_as_a_power_of_time_in_a_hold() -> None:
    hidden = {"ratio": 0.5, "begin_s": 0.05, "exponent": 0.4}
    bench = quiet_bench({"power_law_relaxation": hidden})
    trace = play(bench, stroke(30.0, 8.0, hold_s=5.0), 4.0)
    rest_N = bench.tissue.elastic_N(float(trace.tip_mm[-1]) - SURFACE_MM)
    # Long after a rise of 0.3 s each part of it fades alike, as if all of it had come near its end.
    left = (trace.force_N[trace.at(3.8)] - rest_N) / (trace.force_N[trace.at(1.0)] - rest_N)
    ended_s = 0.36
    expected = [(1 + (at_s - ended_s) / 0.05) ** -0.4 for at_s in (3.8, 1.0)]
    assert left == pytest.approx(expected[0] / expected[1], rel=0.05)


def test_hunt_crossley_damping_is_nothing_at_contact_and_grows_with_the_load() -> None:
    bench = quiet_bench({"hunt_crossley": {"damping_s_mm": 0.01}})
    trace = play(bench, stroke(20.0, 8.0), 0.62)
    depth_mm = trace.tip_mm - SURFACE_MM
    for at_mm in (2.0, 6.0):
        here = crossing(depth_mm, at_mm)
        speed_mm_s = float(np.gradient(trace.tip_mm, trace.time_s)[here])
        elastic_N = bench.tissue.elastic_N(float(depth_mm[here]))
        assert trace.force_N[here] / elastic_N == pytest.approx(1 + 0.01 * speed_mm_s, rel=0.01)


def test_mullins_softening_is_below_the_deepest_place_so_far_only() -> None:
    bench = quiet_bench({"mullins": {"softening": 0.3, "reach_mm": 4.0}})

    def share(depth_mm: float) -> float:
        settle(bench, SURFACE_MM + depth_mm, 2.0)
        return bench.contact_N / bench.tissue.elastic_N(depth_mm)

    assert share(4.0) == pytest.approx(1.0, abs=1e-3)
    assert share(6.0) == pytest.approx(1.0, abs=1e-3)
    assert share(4.0) == pytest.approx(1 - 0.3 * math.erf((36 - 16) / 16), abs=1e-3)


def test_sensor_hysteresis_reads_more_once_the_force_has_fallen() -> None:
    bench = quiet_bench({"sensor_hysteresis": {"level_N": 0.2, "width_N": 0.3}})
    up = settle(bench, SURFACE_MM + 6, 2.0)
    # An axis that overshoots has come down a little.
    assert up.force_N[-1] < up.contact_N[-1] + 0.1
    settle(bench, SURFACE_MM + 8, 2.0)
    down = settle(bench, SURFACE_MM + 6, 2.0)
    assert 0.12 < down.force_N[-1] - down.contact_N[-1] < 0.2


def test_clock_drift_makes_the_force_later_and_later() -> None:
    bench = quiet_bench({"clock_drift": {"gain_ppm": 5000.0}})
    settle(bench, SURFACE_MM - 1, 4.0)
    trace = play(bench, stroke(20.0, 8.0), 0.5)
    now = 400
    late_s = 5e-3 * float(trace.time_s[now])
    before = now - round(1000 * late_s)
    assert trace.force_N[now] == pytest.approx(trace.contact_N[before], abs=0.02)
    assert late_s > 0.02


def test_several_effects_act_together() -> None:
    bench = quiet_bench({"gain_error": {"gain": 0.1}, "zero_drift": {"rate_N_h": 36.0}})
    trace = play(bench, lambda _: 5.0, 1.0)
    assert trace.force_N[-1] == pytest.approx(0.01, abs=1e-6)
    assert list(bench.hidden) == ["gain_error", "zero_drift"]


def test_an_effect_that_stays_on_keeps_its_state_when_another_is_switched() -> None:
    bench = quiet_bench({"friction": {"level_N": 0.2}})
    play(bench, lambda t: 5 + 10 * t, 0.5)
    bench.hide({"friction": {"level_N": 0.2}, "gain_error": {"gain": 0.5}})
    bench.advance(bench.now_ns + MS_NS)
    assert bench.force.zero[2] - bench.force.wrench()[2] == pytest.approx(0.3, abs=1e-3)


def test_one_parameter_given_leaves_the_others_at_their_defaults() -> None:
    assert parse_hidden(["friction.level_N=0.5", "backlash"]) == {
        "backlash": {"gap_mm": 0.3},
        "friction": {"level_N": 0.5, "slip_length_mm": 0.05},
    }


@pytest.mark.parametrize(
    ("option", "sentence"),
    [
        ("fricton.level_N=1", "unknown effect 'fricton'; nearest valid effect: friction"),
        ("friction.level=1", "unknown parameter of friction 'level'; nearest valid parameter of friction: level_N"),
        ("friction=1", "unknown parameter of friction ''"),
        ("friction.level_N=a lot", "'a lot' is not a number"),
        ("friction.level_N", "no value is not a number"),
        ("friction.level_N=99", "friction.level_N is 99, outside 0 to 5"),
        ("friction.level_N=nan", "friction.level_N is nan, outside 0 to 5"),
    ],
)
def test_a_wrong_effect_is_refused_with_the_nearest_right_one(option: str, sentence: str) -> None:
    with pytest.raises(UsageError) as refusal:
        parse_hidden([option])
    assert sentence in str(refusal.value)


def test_effects_stand_in_the_parameter_file_too() -> None:
    parameters = Parameters.model_validate({"hide": {"friction": {"level_N": 0.4}}})
    assert Bench(parameters).hidden == complete({"friction": {"level_N": 0.4}})
    with pytest.raises(UsageError, match="nearest valid effect: relaxation"):
        Bench(Parameters.model_validate({"hide": {"relax": {}}}))
