"""Bounded moves: closed forms of what is told for a set-point that stands, goes on, is late."""

import pytest

from drivers.zaber.following import LEAST_SPEED_MM_S, AxisPlace, Follower, run_on_mm

PERIOD_S, LAG_S = 0.01, 0.02
AHEAD_S = 0.04


def follower(speed_mm_s: float = 50.0) -> Follower:
    return Follower(PERIOD_S, LAG_S, 0.0, 60.0, speed_mm_s)


def ramped(speed_mm_s: float, lag_s: float) -> tuple[float, float]:
    """(target, speed) told to an axis that follows a ramp ``lag_s`` late and was last seen 5 ms ago."""
    leader = follower()
    for step in range(20):
        now_s = step * PERIOD_S
        seen_s = now_s - 0.005
        place = AxisPlace(seen_s, 10.0 + speed_mm_s * (seen_s - lag_s), speed_mm_s)
        move = leader.move(10.0 + speed_mm_s * now_s, now_s, place)
    return move.target_mm - place.at(now_s), move.speed_mm_s


def test_a_set_point_that_stands_is_the_target_itself() -> None:
    leader = follower()
    for step in range(5):
        move = leader.move(12.0, step * PERIOD_S, AxisPlace(step * PERIOD_S - 0.005, 11.8, 0.0))
    assert move.target_mm == pytest.approx(12.0) and move.speed_mm_s == pytest.approx(0.2 / AHEAD_S)


def test_an_axis_at_its_own_lag_is_told_the_speed_of_the_set_point() -> None:
    way_mm, speed_mm_s = ramped(8.0, LAG_S)
    assert way_mm == pytest.approx(8.0 * AHEAD_S) and speed_mm_s == pytest.approx(8.0)


def test_an_axis_behind_its_lag_is_told_to_make_it_up_within_four_periods() -> None:
    _, speed_mm_s = ramped(8.0, LAG_S + 0.01)
    assert speed_mm_s == pytest.approx(8.0 + 0.08 / AHEAD_S)


@pytest.mark.parametrize("setpoint_mm", [-5.0, 70.0])
def test_no_target_is_beyond_the_ends(setpoint_mm: float) -> None:
    move = follower().move(setpoint_mm, 0.0, AxisPlace(-0.005, 30.0, 0.0))
    assert 0.0 <= move.target_mm <= 60.0


def test_no_speed_is_above_the_limit_nor_so_low_that_it_never_ends() -> None:
    fastest = follower(20.0).move(50.0, 0.0, AxisPlace(-0.005, 0.0, 0.0))
    assert fastest.target_mm == pytest.approx(20.0 * AHEAD_S) and fastest.speed_mm_s == 20.0
    assert follower().move(30.0, 0.0, AxisPlace(-0.005, 30.0, 0.0)).speed_mm_s == LEAST_SPEED_MM_S


def test_a_new_program_does_not_take_the_way_there_for_a_speed() -> None:
    leader = follower()
    leader.move(10.0, 0.0, AxisPlace(-0.005, 10.0, 0.0))
    leader.begin()
    assert leader.move(20.0, PERIOD_S, AxisPlace(0.005, 20.0, 0.0)).target_mm == pytest.approx(20.0)


def test_how_far_a_dead_host_lets_it_go() -> None:
    assert run_on_mm(30.0, PERIOD_S) == pytest.approx(1.2)
