"""Each step by itself, cycle by cycle, on a state that is written down: places, times and bounds worked out by hand."""

import math
from typing import Any

import pytest
from pydantic import ValidationError

from controller.law import force_position
from controller.law.force_position import ForceReading
from controller.law.inverse_model import GainRow, columns
from controller.loop.modes import Mode
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.steps import (
    Approach,
    ApproachRun,
    Compress,
    Dither,
    Hold,
    MoveTo,
    Program,
    Retract,
    Run,
    TrackForce,
    Zero,
)
from rig.errors import SafetyStop

DT_S = 0.001
ROWS = tuple(
    GainRow(force_N=force_N, depth_mm=force_N, tangent_N_mm=1.0, damping_N_s_mm=0.01) for force_N in (0.0, 9.0)
)


def state(position_mm: float = 20.0, **values: Any) -> LoopState:
    made = LoopState(position_mm=position_mm, setpoint=Setpoint(position_mm, 0.0), raw_N=0.0, force_N=0.0, zero_N=0.0,
                 wrench=(0.0,) * 6, dt_s=DT_S)  # fmt: skip
    for name, value in values.items():
        setattr(made, name, value)
    return made


def sampled(here: LoopState, raw_N: float, wrench: tuple[float, ...] | None = None) -> LoopState:
    """The next sample of force."""
    here.force_samples += 1
    here.raw_N, here.force_N = raw_N, raw_N - (0.0 if math.isnan(here.zero_N) else here.zero_N)
    here.wrench = wrench or (0.0, 0.0, -raw_N, 0.0, 0.0, 0.0)  # type: ignore[assignment]
    return here


def ends_after(run: Run, here: LoopState, cycles: int = 100_000) -> int:
    """Cycles until the step is over; the axis is where it is told to be."""
    for cycle in range(cycles):
        if run.advance(here, cycle * DT_S):
            return cycle
        here.position_mm = here.setpoint.position_mm
    raise AssertionError("the step did not end")


GOOD_TRACK: dict[str, Any] = {
    "times_s": (0.0, 1.0), "forces_N": (0.0, 0.0), "gains": ROWS, "crossover_rad_s": 0.5
}  # fmt: skip


@pytest.mark.parametrize(
    ("step", "kind", "mode"),
    [
        (Zero(duration_s=1.0), "zero", Mode.FREE),
        (MoveTo(position_mm=1.0, speed_mm_s=1.0), "move", Mode.FREE),
        (Approach(speed_mm_s=1.0, contact_force_N=1.0, search_to_mm=1.0), "approach", Mode.APPROACH),
        (Compress(depth_mm=1.0, speed_mm_s=1.0, force_limit_N=1.0), "compress", Mode.COMPRESS),
        (Hold(duration_s=0.0), "hold", Mode.COMPRESS),
        (Dither(amplitude_mm=1.0, frequency_Hz=1.0, duration_s=1.0), "dither", Mode.COMPRESS),
        (TrackForce(**GOOD_TRACK), "track", Mode.CONTACT),
        (Retract(clearance_mm=1.0, speed_mm_s=1.0), "retract", Mode.RETRACT),
    ],
)
def test_each_step_has_its_word_and_its_mode(step: Any, kind: str, mode: Mode) -> None:
    assert (step.step, step.mode) == (kind, mode)
    assert Program(name="p", steps=(step,)).model_dump(mode="json")["steps"][0]["step"] == kind
    assert Program.model_validate_json(Program(name="p", steps=(step,)).model_dump_json()).steps == (step,)


def test_what_a_step_does_not_say_is_this() -> None:
    approach = Approach(speed_mm_s=1.0, contact_force_N=1.0, search_to_mm=1.0)
    assert (approach.within_mm, approach.touches, approach.touch_speed_mm_s) == (0.2, 0, 0.5)
    assert Retract(clearance_mm=1.0, speed_mm_s=1.0).floor_mm == 0.0
    track = TrackForce(**GOOD_TRACK)
    assert track.model_dump(exclude={"times_s", "forces_N", "gains", "step", "crossover_rad_s"}) == {
        "repeats": 1, "damping_N_s_mm": 0.0, "delay_s": 0.0, "lag1_s": 0.0, "lag2_s": 0.0, "preview_s": 0.0,
        "ahead_mm_s": 24.0, "lead_s": 0.0, "drift_rad_s": 0.0, "drift_limit_mm_s": 5.0, "relaxation": (),
        "friction_N": 0.0, "friction_mm": 1.0, "speed_limit_mm_s": 30.0, "search_speed_mm_s": 5.0,
        "contact_force_N": 0.1,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        (Zero, {"duration_s": 0.5}, {"duration_s": 0.0}),
        (MoveTo, {"position_mm": 0.0, "speed_mm_s": 0.5}, {"speed_mm_s": 0.0}),
        (Hold, {"duration_s": 0.0}, {"duration_s": -0.1}),
        (Approach, {"speed_mm_s": 1.0, "contact_force_N": 0.01, "search_to_mm": 1.0, "touches": 0}, {"touches": -1}),
        (Approach, {"speed_mm_s": 1.0, "contact_force_N": 0.01, "search_to_mm": 1.0, "touches": 10}, {"touches": 11}),
        (Program, {"name": "p", "steps": (Zero(duration_s=1.0),)}, {"steps": ()}),
        *[(TrackForce, {**GOOD_TRACK, name: good}, {name: bad}) for name, good, bad in [
            ("times_s", (0.0, 0.5), (0.0,)), ("times_s", (0.0, 0.5), (-0.1, 0.5)), ("forces_N", (0.0, 0.5), (0.0,)),
            ("forces_N", (0.0, 0.5), (-0.1, 0.5)), ("gains", ROWS, ROWS[:1]), ("repeats", 1, 0),
            ("damping_N_s_mm", 0.0, -0.1), ("damping_N_s_mm", 0.5, -0.1), ("delay_s", 0.0, -0.1),
            ("lag1_s", 0.0, -0.1), ("lag2_s", 0.0, -0.1), ("preview_s", 0.0, -0.1), ("ahead_mm_s", 0.0, -0.1),
            ("crossover_rad_s", 0.1, 0.0), ("lead_s", 0.0, -0.1), ("drift_rad_s", 0.0, -0.1),
            ("drift_limit_mm_s", 0.1, 0.0),
            ("relaxation", ((0.5, 0.5), (0.5, 0.5)), ((0.5, 0.5),) * 3), ("relaxation", ((0.5, 0.1),), ((0.5, 0.0),)),
            ("friction_N", 0.0, -0.1), ("friction_mm", 0.5, 0.0),
        ]],
    ],
)  # fmt: skip
def test_a_step_takes_what_makes_sense_and_nothing_else(kind: Any, good: dict[str, Any], bad: dict[str, Any]) -> None:
    kind(**good)
    with pytest.raises(ValidationError):
        kind(**{**good, **bad})


def test_a_zero_is_the_mean_of_each_sample_once_and_its_noise_their_deviation() -> None:
    here, run = state(zero_N=math.nan, reference_zero=None), Zero(duration_s=0.010).begin()
    wrench = [(0.1, 0.2, 0.3, 0.01, 0.02, 0.03), (0.3, 0.4, 0.5, 0.03, 0.04, 0.05)]
    over = []
    for cycle in range(11):
        if cycle in (0, 4):  # two samples in eleven cycles: each counts once
            sampled(here, (1.0, 2.0)[cycle // 4], wrench[cycle // 4])
        over.append(run.advance(here, cycle * DT_S))
    assert over == [False] * 10 + [True]
    assert here.zero_N == pytest.approx(1.5)
    assert here.noise_N == pytest.approx(0.5)
    assert here.reference_zero == pytest.approx((0.2, 0.3, 0.4, 0.02, 0.03, 0.04))


def zeroed(wrench: tuple[float, ...], reference: tuple[float, ...]) -> LoopState:
    here, run = state(reference_zero=reference), Zero(duration_s=0.001).begin()
    run.advance(sampled(here, 0.7, wrench), 0.0)
    run.advance(here, 0.001)
    return here


def test_a_later_zero_moves_the_zero_and_not_the_reference() -> None:
    here = zeroed((0.5, 0.0, 0.0, 0.0, 0.0, 0.0), (0.1, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert here.reference_zero == (0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert here.zero_N == pytest.approx(0.7)


@pytest.mark.parametrize("channel", range(6))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_zero_may_shift_by_half_a_newton_or_a_twentieth_of_a_newton_metre(channel: int, sign: float) -> None:
    limit = 0.5 if channel < 3 else 0.05
    reference = (0.0,) * 6
    shifted = [sign * limit * (at == channel) for at in range(6)]
    zeroed(tuple(shifted), reference)
    name, unit = ("fx", "fy", "fz", "mx", "my", "mz")[channel], "N" if channel < 3 else "N m"
    words = f"{name} in the air moved by {sign * limit * 1.2:+.2g} {unit} since the first zero (limit {limit:g} {unit})"
    with pytest.raises(SafetyStop) as stop:
        zeroed(tuple(1.2 * shift for shift in shifted), reference)
    assert str(stop.value).startswith(words)


def test_of_several_shifts_the_one_furthest_beyond_its_limit_is_named() -> None:
    with pytest.raises(SafetyStop, match="mx in the air"):
        zeroed((1.0, 0.0, 0.0, 0.2, 0.0, 0.0), (0.0,) * 6)


def test_a_zero_that_is_no_number_is_refused() -> None:
    with pytest.raises(SafetyStop, match="in the air moved by"):
        zeroed((math.nan,) + (0.0,) * 5, (0.0,) * 6)


def test_a_move_takes_distance_over_speed_and_one_ramp() -> None:
    here = state(10.0)
    cycles = ends_after(MoveTo(position_mm=15.0, speed_mm_s=20.0).begin(), here)
    assert cycles * DT_S == pytest.approx(5.0 / 20.0 + 20.0 / here.acceleration_mm_s2, abs=0.006)
    assert here.setpoint == Setpoint(15.0, 0.0)


APPROACH = Approach(speed_mm_s=10.0, contact_force_N=0.1, search_to_mm=40.0, touches=2)


@pytest.mark.parametrize(
    ("contact_N", "noise_N", "threshold_N"),
    # contact force, ten times the noise but not above 1 N for that, four times the noise; friction of 0.5 N beside it
    [(0.1, 0.0, 0.6), (0.1, 0.05, 1.0), (0.1, 0.2, 1.5), (0.1, 0.3, 1.7), (3.0, 0.3, 3.5)],
)
def test_what_may_be_contact_is_above_noise_rubbing_and_what_was_asked_for(
    contact_N: float, noise_N: float, threshold_N: float
) -> None:
    run = Approach(speed_mm_s=10.0, contact_force_N=contact_N, search_to_mm=40.0).begin()
    assert run.threshold_N(state(noise_N=noise_N)) == pytest.approx(threshold_N)


def approached(forces_N: list[float], step: Approach = APPROACH) -> tuple[ApproachRun, LoopState, list[bool]]:
    """A sample each cycle, standing in the air: nothing has moved yet, so 0.6 N may be contact."""
    here, run = state(), step.begin()
    searching = []
    for force_N in forces_N:
        run.advance(sampled(here, force_N), 0.0)
        searching.append(run.searches)
    return run, here, searching


def test_contact_is_three_samples_in_a_row_above_the_threshold() -> None:
    assert approached([0.61, 0.61, 0.61])[2] == [True, True, False]
    assert approached([0.61, 0.61, 0.6, 0.61, 0.61, 0.61])[2] == [True] * 5 + [False]


def test_a_sample_counts_once_however_often_the_loop_cycles() -> None:
    here, run = sampled(state(), 5.0), APPROACH.begin()
    for _ in range(10):
        run.advance(here, 0.0)
    assert run.searches
    assert run._above == 1


def test_the_touch_is_made_as_the_step_asks_and_the_axis_rests_for_it() -> None:
    run, here, _ = approached([1.0, 1.0, 1.0])
    assert run._touch is not None
    assert tuple(run._touch._touching) == (0.2, 2, 0.5, 5.0)
    assert run._touch._sound is False, "the guide had not slipped"
    assert here.setpoint.velocity_mm_s == 0.0


def test_friction_is_the_mean_force_between_a_quarter_and_half_a_millimetre() -> None:
    here, run = state(10.0), APPROACH.begin()
    thresholds = []
    for position_mm, force_N in ((10.0, 9.9), (10.24, 9.9), (10.25, 0.1), (10.49, 0.3), (10.5, 9.9), (10.7, 9.9)):
        here.position_mm = position_mm
        sampled(here, force_N)
        run._seen, run._above = -1, -100
        run.advance(here, 0.0)
        thresholds.append(run.threshold_N(here))
    assert thresholds == pytest.approx([0.6, 0.6, 0.6, 0.6, 0.3, 0.3])
    assert run.has_run_in


@pytest.mark.parametrize(("force_N", "friction_N"), [(-3.0, 0.0), (0.2, 0.2), (3.0, 0.5)])
def test_friction_is_never_negative_and_never_above_half_a_newton(force_N: float, friction_N: float) -> None:
    here, run = state(10.0), APPROACH.begin()
    for position_mm in (10.0, 10.3, 10.6):
        here.position_mm = position_mm
        run._above = -100
        run.advance(sampled(here, force_N), 0.0)
    assert run.threshold_N(here) == pytest.approx(0.1 + friction_N)


def test_loading_is_collected_from_the_start_and_again_from_where_the_guide_has_slipped() -> None:
    here, run = state(10.0), APPROACH.begin()
    here.paired.samples = 7
    run.advance(sampled(here, 0.0), 0.0)
    assert (here.paired.collecting, here.paired.samples) == (True, 0)
    here.paired.samples = 7
    here.position_mm = 10.3
    run.advance(sampled(here, 0.0), 0.0)
    assert here.paired.samples == 7
    here.position_mm = 10.5
    run.advance(sampled(here, 0.0), 0.0)
    assert here.paired.samples == 0


def test_a_search_goes_at_its_speed_to_its_end_and_says_what_it_looked_for() -> None:
    here, run = state(39.0), APPROACH.begin()
    with pytest.raises(SafetyStop) as stop:
        ends_after(run, here)
    assert str(stop.value).startswith("no contact down to 40 mm (threshold 0.1 N): is the limb under the tip?")
    assert here.setpoint.position_mm == 40.0


def test_a_search_moves_no_faster_than_asked() -> None:
    here, run = state(0.0), APPROACH.begin()
    for _ in range(1000):
        before_mm = here.setpoint.position_mm
        run.advance(here, 0.0)
        assert here.setpoint.position_mm - before_mm <= 10.0 * DT_S + 1e-12
    assert here.setpoint.position_mm == pytest.approx(10.0, abs=0.05)


def test_a_compression_ends_at_its_depth_below_the_surface() -> None:
    here = state(20.0, surface_mm=20.0)
    cycles = ends_after(Compress(depth_mm=5.0, speed_mm_s=20.0, force_limit_N=9.0).begin(), here)
    assert here.setpoint == Setpoint(25.0, 0.0)
    assert cycles * DT_S == pytest.approx(5.0 / 20.0 + 20.0 / 2000.0, abs=0.006)
    assert here.outcome == ""


def test_a_compression_ends_above_its_force_where_it_is() -> None:
    here, step = state(20.0, surface_mm=20.0, setpoint=Setpoint(22.0, 20.0)), None
    step = Compress(depth_mm=5.0, speed_mm_s=20.0, force_limit_N=9.0).begin()
    here.force_N = 9.0
    assert not step.advance(here, 0.0)
    here.force_N, at_mm = 9.01, here.setpoint.position_mm
    assert step.advance(here, 0.0)
    assert (here.setpoint, here.outcome) == (Setpoint(at_mm, 0.0), "force limit")


def test_a_hold_lasts_its_time_and_moves_nothing() -> None:
    here = state()
    assert ends_after(Hold(duration_s=0.25).begin(), here) == 250
    assert here.setpoint == Setpoint(20.0, 0.0)
    assert ends_after(Hold(duration_s=0.0).begin(), here) == 0


def test_a_dither_is_a_sine_of_whole_periods_about_where_it_began() -> None:
    here, run = state(), Dither(amplitude_mm=0.5, frequency_Hz=4.0, duration_s=0.3).begin()
    path = []
    for cycle in range(501):
        over = run.advance(here, cycle * DT_S)
        path.append(here.setpoint.position_mm)
        assert here.setpoint.velocity_mm_s == 0.0
        assert over is (cycle == 500)  # 0.3 s are 1.2 periods, so two are made
    expected = [20.0 + 0.5 * math.sin(2 * math.pi * 4.0 * cycle * DT_S) for cycle in range(500)]
    assert path == pytest.approx([*expected, 20.0])


def tracking(**changes: Any) -> TrackForce:
    values: dict[str, Any] = {"times_s": (0.0, 2.0), "forces_N": (1.0, 3.0), "gains": ROWS, "ahead_mm_s": 0.0,
                              "crossover_rad_s": 10.0}  # fmt: skip
    return TrackForce(**{**values, **changes})


def contacting(force_N: float = 1.0, **values: Any) -> LoopState:
    return state(21.0, surface_mm=20.0, force_N=force_N, force_samples=1, **values)


def test_the_reference_is_joined_by_straight_lines_and_the_step_lasts_as_long() -> None:
    here, run = contacting(), tracking(repeats=2).begin()
    over = []
    for elapsed_s in (0.0, 1.0, 1.999, 2.5, 3.999, 4.0):
        over.append(run.advance(here, elapsed_s))
        assert here.reference_N == pytest.approx(1.0 + elapsed_s % 2.0 if elapsed_s < 4.0 else 3.0)
    assert over == [False] * 5 + [True]


def test_a_late_force_moves_nothing_and_the_reference_goes_on() -> None:
    here, run = contacting(force_late=True, setpoint=Setpoint(21.0, 7.0)), tracking().begin()
    assert run.advance(here, 1.0) is False
    assert (here.setpoint, here.reference_N, here.memory) == (Setpoint(21.0, 0.0), 2.0, None)
    assert run.advance(here, 2.0) is True


def expected_mm(here: LoopState, step: TrackForce, asked_N: float) -> float:
    """One increment of the law from where it begins, which has tests of its own."""
    table = columns(step.gains)
    memory = force_position.begin(table, step.settings.inverse, here.force_N)
    reading = ForceReading(here.force_N, 1)
    step_mm, _ = force_position.increment(memory, table, step.settings, asked_N, reading, here.dt_s)
    return step_mm


def test_the_set_point_moves_by_the_laws_increment() -> None:
    here, step = contacting(), tracking()
    moved_mm = expected_mm(here, step, 1.01)
    step.begin().advance(here, 0.01)
    assert 0 < moved_mm < 0.03
    assert here.setpoint == pytest.approx((21.0 + moved_mm, moved_mm / DT_S))
    assert here.memory is not None and here.tangent_N_mm == here.memory.tangent_N_mm == 1.0


def test_the_law_goes_on_where_the_track_step_before_it_ended() -> None:
    here = contacting()
    tracking(drift_rad_s=1.0).begin().advance(here, 0.01)
    assert here.memory
    drift_mm_s = here.memory.correction.drift_mm_s
    tracking(drift_rad_s=0.0).begin().advance(here, 0.0)
    assert here.memory.correction.drift_mm_s == drift_mm_s > 0.0


def test_after_a_late_force_the_law_starts_anew_at_the_force_measured() -> None:
    here, run = contacting(), tracking(drift_rad_s=1.0).begin()
    run.advance(here, 0.01)
    here.force_late = True
    run.advance(here, 0.02)
    here.force_late, here.force_N = False, 2.0
    run.advance(here, 0.5)
    assert here.memory
    assert (here.memory.expected.start_N, here.memory.samples) == (2.0, here.force_samples)


def test_a_sample_is_acted_on_once_and_its_speed_kept_until_the_next() -> None:
    here, run = contacting(), tracking(forces_N=(2.0, 2.0)).begin()
    speeds_mm_s = []
    for cycle in range(4):
        here.force_samples += cycle == 2
        run.advance(here, cycle * DT_S)
        speeds_mm_s.append(here.setpoint.velocity_mm_s)
    assert 0 < speeds_mm_s[0] == speeds_mm_s[1] < speeds_mm_s[2] == speeds_mm_s[3]


def test_a_preview_asks_earlier_for_what_will_be_wanted() -> None:
    here, step = contacting(), tracking(preview_s=0.5)
    moved_mm = expected_mm(here, step, 1.51)
    step.begin().advance(here, 0.01)
    assert here.reference_N == pytest.approx(1.01)
    assert here.setpoint.position_mm == pytest.approx(21.0 + min(moved_mm, 0.03))


@pytest.mark.parametrize(
    ("force_N", "asked_N", "fastest_mm_s"),
    # Half the contact force of 0.1 N: below it and asked for more, the tip only searches.
    [(0.04, 3.0, 5.0), (0.05, 3.0, 30.0), (0.04, 0.06, 5.0), (1.0, 3.0, 30.0)],
)
def test_out_of_contact_the_tip_only_searches(force_N: float, asked_N: float, fastest_mm_s: float) -> None:
    here = contacting(force_N)
    run = tracking(forces_N=(asked_N, asked_N), crossover_rad_s=1e6).begin()
    run.advance(here, 0.0)
    before_mm = here.setpoint.position_mm
    for _ in range(5):
        run.advance(here, 0.001)
    assert abs(here.setpoint.velocity_mm_s) <= fastest_mm_s + 1e-9
    assert abs(here.setpoint.position_mm - before_mm) <= 5 * fastest_mm_s * DT_S + 1e-9


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_increment_is_faster_than_the_limit_either_way(sign: float) -> None:
    here = contacting(5.0 - 4.0 * sign)
    tracking(forces_N=(5.0, 5.0), crossover_rad_s=1e6).begin().advance(here, 0.0)
    assert here.setpoint.velocity_mm_s == pytest.approx(sign * 30.0)
    assert here.setpoint.position_mm == pytest.approx(21.0 + sign * 0.03)


def test_a_search_has_its_own_speed() -> None:
    for force_N, fastest_mm_s in ((0.049, 5.0), (0.05, 30.0)):
        here = contacting(force_N)
        tracking(forces_N=(5.0, 5.0), crossover_rad_s=1e6).begin().advance(here, 0.0)
        assert here.setpoint.velocity_mm_s == pytest.approx(fastest_mm_s)
    here = contacting(0.0)
    tracking(forces_N=(0.05, 0.05), crossover_rad_s=1e6).begin().advance(here, 0.0)
    assert here.setpoint.velocity_mm_s == pytest.approx(30.0), "a reference that is no contact is no search"


def test_the_law_is_told_what_the_step_says_of_tissue_and_axis() -> None:
    step = tracking(
        damping_N_s_mm=0.1, ahead_mm_s=3.0, relaxation=((0.7, 0.8), (0.9, 1.0)), friction_N=1.1, friction_mm=1.2,
        delay_s=1.3, lag1_s=1.4, lag2_s=1.5, crossover_rad_s=1.6, lead_s=1.7, drift_rad_s=1.8, drift_limit_mm_s=1.9,
        speed_limit_mm_s=2.1, search_speed_mm_s=2.2, contact_force_N=4.6,
    )  # fmt: skip
    inverse, feedback = step.settings
    assert tuple(inverse) == (0.1, 3.0, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2)
    assert tuple(feedback) == (1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 2.1, 2.2, 2.3)
    assert tuple(tracking().settings.inverse)[2:6] == (0.0, 1.0, 0.0, 1.0)
    assert tuple(tracking(relaxation=((0.7, 0.8),)).settings.inverse)[2:6] == (0.7, 0.8, 0.0, 1.0)
    assert tuple(step.given) == ((0.0, 2.0), (1.0, 3.0), 1)


def test_a_retraction_ends_a_clearance_above_the_surface_and_forgets_the_law() -> None:
    here = state(25.0, surface_mm=20.0, reference_N=1.0, tangent_N_mm=2.0)
    here.memory = force_position.begin(columns(ROWS), tracking().settings.inverse, 1.0)
    ends_after(Retract(clearance_mm=5.0, speed_mm_s=10.0).begin(), here)
    assert here.setpoint == Setpoint(15.0, 0.0)
    assert math.isnan(here.reference_N) and math.isnan(here.tangent_N_mm)
    assert str(here.memory) == "None"


@pytest.mark.parametrize(
    ("surface_mm", "floor_mm", "target_mm"),
    [(20.0, 0.0, 15.0), (math.nan, 0.0, 20.0), (3.0, 0.0, 0.0), (20.0, 17.0, 17.0)],
)
def test_a_retraction_leaves_from_the_surface_or_from_where_it_is_and_not_below_its_floor(
    surface_mm: float, floor_mm: float, target_mm: float
) -> None:
    step = Retract(clearance_mm=5.0, speed_mm_s=10.0, floor_mm=floor_mm)
    assert step.target_mm(state(25.0, surface_mm=surface_mm)) == target_mm


def test_the_noise_of_the_moment_is_its_rms_from_the_zero() -> None:
    here, run = state(zero_N=math.nan), Zero(duration_s=0.01).begin()
    for elapsed_s, moment_N_m in ((0.0, 0.006), (0.01, 0.0)):
        over = run.advance(sampled(here, 0.8, (0.0, 0.0, -0.8, moment_N_m, 0.0, 0.0)), elapsed_s)
    # 0.003 N m on either side of a mean of 0.003 N m.
    assert over
    assert here.noise_N_m == pytest.approx(0.003)


def test_after_contact_every_cycle_is_the_touchs() -> None:
    here, run = state(10.0), APPROACH.begin()
    while run.searches:
        run.advance(sampled(here, 5.0), 0.0)
    assert run._touch
    seen: list[LoopState] = []

    def phase(state: LoopState) -> bool:
        seen.append(state)
        return False

    run._touch._phase = phase
    assert not run.advance(here, 0.0)
    assert seen == [here]


def test_the_law_is_told_where_the_tip_is_and_what_presses_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[Any, ...]] = []
    begin, increment = force_position.begin, force_position.increment

    def begins(*values: Any) -> Any:
        told.append(values)
        return begin(*values)

    def goes_on(*values: Any) -> Any:
        told.append(values)
        return increment(*values)

    monkeypatch.setattr(force_position, "begin", begins)
    monkeypatch.setattr(force_position, "increment", goes_on)
    step, here = tracking(friction_N=0.3), contacting(1.2)
    step.begin().advance(here, 0.01)
    (begun, asked) = told
    assert begun[1:] == (step.settings.inverse, 1.2)
    assert asked[2:] == (step.settings, pytest.approx(1.01), (1.2, 1), DT_S)
