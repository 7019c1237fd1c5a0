"""The residual is judged by what recordings share: no sample outweighs them, no turning counts what was seen twice."""

import numpy as np
import pytest

from rig.diagnosis.evidence import _signs, chance
from rig.diagnosis.fit import MOST_OF_ONE_ROW, bounded
from rig.diagnosis.lack_of_fit import _press_log_density, bumps


@pytest.mark.parametrize("recordings", [6, 7, 12, 60])
def test_no_draw_turns_all_recordings_or_none_and_none_comes_twice(recordings: int) -> None:
    signs = _signs(recordings, np.random.default_rng(1), 200)
    assert set(np.unique(signs)) == {-1.0, 1.0}
    assert np.all(np.abs(signs.sum(axis=1)) < recordings)
    both_ways = {tuple(row * row[0]) for row in signs}
    assert len(both_ways) == len(signs) == min(200, 2 ** (recordings - 1) - 1)


def test_turned_recordings_object_only_where_one_turning_does_as_well() -> None:
    drawn, turned = np.zeros(399), np.linspace(0, 5, 31)
    assert chance((drawn, turned), 6.0) == 1 / 400
    assert chance((drawn, turned), 4.9) == 2 / 32
    assert chance((drawn, np.empty(0)), 6.0) == 1 / 400


def test_a_row_with_the_derivative_of_a_kink_knows_no_more_than_a_twentieth_of_all() -> None:
    columns = np.random.default_rng(2).standard_normal((2000, 3))
    kinked = columns.copy()
    kinked[700, 1] = 1e5
    found = bounded(kinked)
    leverage = np.einsum("np,pq,nq->n", found, np.linalg.inv(found.T @ found), found)
    assert leverage.max() < 1.6 * MOST_OF_ONE_ROW
    np.testing.assert_array_equal(np.delete(found, 700, axis=0), np.delete(columns, 700, axis=0))
    np.testing.assert_array_equal(bounded(columns), columns)


def test_the_fastest_hundredth_of_the_samples_has_a_bump_of_its_own() -> None:
    velocity = np.concatenate([np.zeros(9900), np.full(50, 25.0), np.full(50, 30.0)])
    fast = bumps(velocity)[-1]
    assert fast[-1] == 1.0
    assert np.all(np.diff(fast) > 0)


def test_a_step_in_mid_session_is_predicted_better_by_a_step_than_by_a_trend() -> None:
    cycle, rng = np.arange(12.0), np.random.default_rng(3)
    level, step = np.ones(12), np.where(cycle >= 6, 1.0, 0.0)
    stepped, drifted = 0.08 * step + 0.01 * rng.standard_normal(12), 0.01 * cycle + 0.01 * rng.standard_normal(12)
    by_trend, by_step = np.column_stack([level, cycle]), np.column_stack([level, step])
    assert _press_log_density(by_step, stepped) > _press_log_density(by_trend, stepped) + 3
    assert _press_log_density(by_trend, drifted) > _press_log_density(by_step, drifted) + 3
