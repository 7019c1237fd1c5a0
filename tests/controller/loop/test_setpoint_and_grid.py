"""Set-points move as told, and the time grid skips what it missed."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.loop.executive import Grid, sleep_then_spin
from controller.loop.setpoint import Setpoint, arrived, toward

DT_S = 0.001


def run(target_mm: float, speed_mm_s: float, acceleration_mm_s2: float, start: Setpoint) -> list[Setpoint]:
    path = [start]
    while not arrived(path[-1], target_mm) and len(path) < 200_000:
        path.append(toward(path[-1], target_mm, speed_mm_s, acceleration_mm_s2, DT_S))
    return path


def test_a_move_at_constant_speed_takes_distance_over_speed_plus_one_ramp() -> None:
    path = run(10.0, 20.0, 2000.0, Setpoint(0.0, 0.0))
    assert (len(path) - 1) * DT_S == pytest.approx(10.0 / 20.0 + 20.0 / 2000.0, abs=0.004)
    assert path[-1] == Setpoint(10.0, 0.0)


@given(
    target_mm=st.floats(-50, 50),
    speed_mm_s=st.floats(1, 60),
    acceleration_mm_s2=st.floats(100, 5000),
    start_mm=st.floats(-50, 50),
    start_mm_s=st.floats(-60, 60),
)
def test_every_move_arrives_and_never_exceeds_speed_or_acceleration(
    target_mm: float, speed_mm_s: float, acceleration_mm_s2: float, start_mm: float, start_mm_s: float
) -> None:
    path = run(target_mm, speed_mm_s, acceleration_mm_s2, Setpoint(start_mm, start_mm_s))
    assert arrived(path[-1], target_mm)
    fastest = max(speed_mm_s, abs(start_mm_s)) + 1e-9
    assert all(abs(point.velocity_mm_s) <= fastest for point in path)
    changes = [abs(b.velocity_mm_s - a.velocity_mm_s) for a, b in pairwise(path[:-1])]
    assert all(change <= acceleration_mm_s2 * DT_S + 1e-9 for change in changes)


@given(target_mm=st.floats(-50, 50), start_mm=st.floats(-50, 50))
def test_a_move_from_rest_stays_between_start_and_target(target_mm: float, start_mm: float) -> None:
    low, high = min(start_mm, target_mm) - 0.02, max(start_mm, target_mm) + 0.02
    assert all(low <= point.position_mm <= high for point in run(target_mm, 30.0, 2000.0, Setpoint(start_mm, 0.0)))


def test_slots_on_time_come_one_after_the_other() -> None:
    grid = Grid(start_ns=0, period_ns=10)
    assert [grid.following(now) for now in (-5, 3, 14)] == [(0, 0), (1, 10), (2, 20)]
    assert grid.missed == 0


def test_a_loop_that_comes_late_runs_the_slot_it_is_in_and_counts_what_it_missed() -> None:
    grid = Grid(start_ns=0, period_ns=10)
    grid.following(-5)
    assert grid.following(55) == (5, 50)
    assert grid.missed == 4
    assert grid.following(56) == (6, 60)
    assert grid.missed == 4


@given(times=st.lists(st.integers(0, 500), min_size=1).map(sorted))
def test_no_slot_is_handed_out_twice_and_every_number_is_run_or_missed(times: list[int]) -> None:
    grid = Grid(start_ns=0, period_ns=10)
    numbers = [grid.following(now)[0] for now in times]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] + 1 == len(numbers) + grid.missed


@pytest.mark.parametrize(("late_ns", "woke_ns"), [(40_000, 1_000_000), (120_000, 1_000_000), (300_000, 1_180_000)])
def test_a_wake_up_no_later_than_the_spin_is_on_time(late_ns: int, woke_ns: int) -> None:
    now = [0]

    def clock() -> int:
        now[0] += 1_000
        return now[0]

    def sleep(due_ns: int) -> None:
        now[0] = due_ns + late_ns

    sleep_then_spin(120_000, clock, sleep)(1_000_000)
    assert now[0] == pytest.approx(woke_ns, abs=1_000)
