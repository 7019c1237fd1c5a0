"""Where a search for a limb that is not felt any more ends."""

import math

import pytest

from controller.loop.state import LoopState
from controller.safety.lost_contact import LostContact


def resting(depth_mm: float, force_N: float, noise_N: float = 0.005) -> LoopState:
    return LoopState(position_mm=20.0 + depth_mm, surface_mm=20.0, force_N=force_N, noise_N=noise_N)


def test_the_search_ends_three_millimetres_beyond_the_last_place_that_was_felt() -> None:
    contact = LostContact()
    assert contact.update(resting(2.0, 0.05)) == ""
    assert contact.update(resting(5.0, 0.049)) == ""
    said = contact.update(resting(5.01, 0.049))
    assert said.startswith("nothing is felt 3.0 mm beyond where the limb was felt last (limit 3 mm)")
    assert contact.update(resting(5.01, 0.05)) == "", "it is there again"
    assert contact.update(resting(8.0, 0.0)) == ""
    assert contact.update(resting(8.02, 0.0)) != ""


def test_in_the_tissue_the_last_place_that_was_felt_counts_however_far_out_the_tip_went() -> None:
    contact = LostContact()
    assert [
        contact.update(resting(depth_mm, force_N)) for depth_mm, force_N in ((6.0, 1.0), (0.5, 0.0), (8.9, 0.0))
    ] == (3 * [""])
    assert contact.update(resting(9.01, 0.0)) != ""


def test_before_anything_was_felt_the_surface_counts() -> None:
    assert LostContact().update(resting(3.01, 0.0)) != ""


def test_out_of_the_tissue_the_surface_counts_again_and_before_any_nothing_does() -> None:
    contact = LostContact()
    assert contact.update(resting(6.0, 1.0)) == ""
    assert contact.update(resting(0.0, 0.0)) == ""
    assert contact.update(resting(3.0, 0.0)) == ""
    assert contact.update(resting(3.01, 0.0)) != ""
    contact.begin()
    assert contact.update(LoopState(position_mm=30.0, force_N=0.0)) == ""
    contact.begin()
    assert contact.update(resting(2.9, 0.0)) == ""
    assert contact.update(resting(3.1, math.nan)) != "", "the first place is the surface"


@pytest.mark.parametrize(("force_N", "felt"), [(0.2, True), (0.19, False)])
def test_four_times_the_noise_is_felt(force_N: float, felt: bool) -> None:
    contact = LostContact()
    contact.update(resting(0.0, 0.0, noise_N=0.05))
    assert (contact.update(resting(3.5, force_N, noise_N=0.05)) == "") is felt
