"""The chain from sample to set-point on rows made by hand: every time is known."""

import numpy as np
import pytest

from benchmarks.sensor_to_drive import chain_us, delays_us
from rig.channels import AXIS, FORCE, LOOP

MS = 1_000_000


def tables(age_of_second_ns: int = 300_000) -> dict[str, "np.ndarray[tuple[int], np.dtype[np.void]]"]:
    """Two samples captured at 10 and 11 ms; four cycles, each sample used by two of them."""
    force, loop, axis = np.zeros(2, FORCE.dtype), np.zeros(4, LOOP.dtype), np.zeros(4, AXIS.dtype)
    force["capture_ns"], force["device_us"] = [10 * MS, 11 * MS], [500, 1500]
    loop["capture_ns"] = [10 * MS + 300_000, 10 * MS + 800_000, 11 * MS + 300_000, 11 * MS + 800_000]
    loop["force_age_ns"] = [300_000, 800_000, age_of_second_ns, 800_000]
    axis["capture_ns"] = loop["capture_ns"] + 60_000
    return {"force": force, "loop": loop, "axis": axis}


FOUND = [10 * MS + 450_000, 10 * MS + 950_000, 11 * MS + 500_000, 11 * MS + 990_000]


def test_each_sample_counts_once_from_the_devices_own_time_to_the_first_set_point_made_from_it() -> None:
    taken = [(500, 10 * MS + 100_000), (1500, 11 * MS + 120_000)]
    assert chain_us(tables(), taken, FOUND) == [350.0, 380.0]


def test_a_set_point_that_was_lost_or_a_sample_that_nobody_saw_counts_nothing() -> None:
    assert chain_us(tables(), [(1500, 11 * MS + 120_000)], FOUND) == [380.0]
    assert chain_us(tables(), [(500, 10 * MS + 100_000), (1500, 11 * MS + 120_000)], FOUND[:2]) == [350.0]


def test_a_sample_that_was_used_a_cycle_late_is_a_cycle_slower() -> None:
    """The second sample found only by the fourth cycle: the third used the first one again."""
    taken = [(500, 10 * MS + 100_000), (1500, 11 * MS + 120_000)]
    assert chain_us(tables(age_of_second_ns=1_300_000), taken, FOUND) == [350.0, 870.0]


def test_a_sync_goes_with_the_first_arrival_that_no_earlier_one_has() -> None:
    assert delays_us(np.array([0, 1000, 2000]), [500, 1500, 1600, 2500]) == pytest.approx([0.5, 0.5, 0.5])
    assert delays_us(np.array([0, 1000]), [700]) == [0.7]
