"""A touch cycle by cycle, on states that are written down: when it rests, backs off and touches again; what it says."""

from typing import Any

import numpy as np
import pytest

from controller.loop import touch as module
from controller.loop.paired_samples import Touch
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.touch import Touching, TouchRun
from rig.trials.contact import LIMB_SHAPE, Contact, Loading

DETECTED_MM, DETECTED_N = 20.5, 0.4
TOUCHING = Touching(within_mm=0.25, touches=3, speed_mm_s=0.5, back_off_mm_s=5.0)


def state(rows: int = 0, first_mm: float = 18.0, **values: Any) -> LoopState:
    """At detection; so many rows of force, a tenth of a millimetre apart, were taken on the way."""
    made = LoopState(position_mm=DETECTED_MM, setpoint=Setpoint(DETECTED_MM, 5.0), force_N=DETECTED_N, noise_N=0.05)
    made.paired.collecting = True
    for number in range(rows):
        made.paired.axis(number + 1, first_mm + 0.1 * number)
        made.paired.force(number + 1, 0.01 * number)
    for name, value in values.items():
        setattr(made, name, value)
    return made


def detected(here: LoopState, touching: Touching = TOUCHING, slipped: bool = True, slow: int = 0) -> TouchRun:
    run = TouchRun(here, touching, slipped)
    run._slow = slow
    return run


def contact(within_mm: float, position_mm: float = 20.0) -> Contact:
    low_mm, high_mm = position_mm - within_mm, position_mm + within_mm
    return Contact(position_mm, low_mm, high_mm, 0.1, low_mm, high_mm)


@pytest.mark.parametrize(
    ("rows", "first_mm", "low_mm"),
    # The force may have begun anywhere on the way there are samples of, at most 4 mm back without any.
    [(0, 0.0, DETECTED_MM - 4.0), (3, 19.0, 19.0), (1, 20.7, DETECTED_MM)],
)
def test_too_few_samples_leave_the_place_of_detection_and_the_way_before_it(
    rows: int, first_mm: float, low_mm: float
) -> None:
    here = state(rows, first_mm)
    run = detected(here, TOUCHING._replace(touches=0), slow=0)
    expected = Contact(DETECTED_MM, low_mm, DETECTED_MM, 0.0, low_mm, DETECTED_MM)
    assert run._unknown(here) == pytest.approx(expected)
    assert run.advance(here)
    assert here.setpoint == Setpoint(DETECTED_MM, 0.0)
    assert here.surface_mm == DETECTED_MM
    assert here.touch == Touch(DETECTED_MM, low_mm, DETECTED_MM, DETECTED_MM, DETECTED_N, rows, 0)


@pytest.mark.parametrize(("rows", "searched"), [(7, False), (8, True)])
def test_eight_rows_are_enough_to_search(rows: int, searched: bool) -> None:
    loading = state(rows).paired.loading
    assert (module._search(loading, 0.05) is not None) is searched


@pytest.mark.parametrize(("length_mm", "air_mm"), [(1.0, 0.2), (1.5, 0.3), (3.0, 0.3)])
def test_the_first_third_of_a_millimetre_or_fifth_of_the_way_is_taken_for_air(
    monkeypatch: pytest.MonkeyPatch, length_mm: float, air_mm: float
) -> None:
    asked: list[tuple[Any, ...]] = []

    def search(loading: Loading, search_mm: Any, noise_N: float, families: Any, rounds: int) -> Any:
        asked.append((search_mm, noise_N, families, rounds))

    monkeypatch.setattr(module, "ContactSearch", search)
    places_mm = np.linspace(10.0, 10.0 + length_mm, 20)
    module._search(Loading(places_mm, places_mm, np.ones(20)), 0.05)
    ((search_mm, *rest),) = asked
    assert search_mm == pytest.approx((10.0 + air_mm, 10.0 + length_mm))
    assert rest == [0.05, LIMB_SHAPE, 3]


@pytest.mark.parametrize(("dt_s", "portions"), [(0.0001, 1), (0.0005, 1), (0.001, 2), (0.01, 20)])
def test_a_cycle_takes_as_many_portions_as_it_has_time_for(dt_s: float, portions: int) -> None:
    here = state(40, 16.6, dt_s=dt_s)
    run = detected(here)
    assert not run.advance(here), "the first cycle only begins the search"
    assert run._search and run._search._done == 0
    assert not run.advance(here)
    assert run._search._done == portions
    assert not here.paired.collecting


@pytest.mark.parametrize(
    ("within_mm", "rows", "slipped", "slow", "known"),
    [
        (0.25, 40, True, 0, True),  # just well enough
        (0.26, 40, True, 0, False),
        (0.25, 40, False, 0, False),  # the guide's friction is in it
        (0.26, 40, True, 1, False),
        (0.26, 40, True, 3, True),  # as often as allowed
        (9.0, 7, True, 0, False),
        (9.0, 7, True, 1, True),  # a slow touch without samples: another would tell no more
        (9.0, 8, True, 1, False),
    ],
)
def test_a_surface_is_taken_once_it_is_known_or_cannot_be_known_better(
    within_mm: float, rows: int, slipped: bool, slow: int, known: bool
) -> None:
    here = state(rows, 20.5 - 0.1 * rows)
    run = detected(here, slipped=slipped, slow=slow)
    assert run._settle(here, contact(within_mm)) is known
    if known:
        assert here.touch == Touch(20.0, 20.0 - within_mm, 20.0 + within_mm, DETECTED_MM, DETECTED_N, rows, slow)
        assert here.surface_mm == 20.0
    else:
        assert here.touch is None
        assert run._phase == run._back_off


@pytest.mark.parametrize(("slow", "kept"), [(0, 0), (1, 40)])
def test_the_first_back_off_forgets_the_fast_loading_and_later_ones_keep_the_slow(slow: int, kept: int) -> None:
    here = state(40, 16.6)
    run = detected(here, slow=slow)
    run._settle(here, contact(0.3))
    # A millimetre above the interval, 20 - 0.3 - 1 mm.
    here.setpoint = Setpoint(18.7, 0.0)
    assert not run.advance(here)
    assert here.paired.samples == kept
    assert (run._slow, run._sound, run._phase) == (slow + 1, True, run._touch)


def touching(position_mm: float, force_N: float = 0.0, found_mm: float = 20.0) -> tuple[TouchRun, LoopState]:
    """On the way in again, from 18.7 mm where the surface was found at 20 mm."""
    here = state(40, 16.6)
    run = detected(here)
    run._settle(here, contact(0.3, found_mm))
    run._phase = run._touch
    here.position_mm, here.setpoint, here.force_N = position_mm, Setpoint(position_mm, 0.0), force_N
    here.paired.collecting = False
    return run, here


@pytest.mark.parametrize(("position_mm", "collecting"), [(18.7, False), (19.2, False), (19.21, True)])
def test_a_touch_collects_once_the_guide_has_slipped(position_mm: float, collecting: bool) -> None:
    run, here = touching(position_mm)
    assert here.position_min_mm == 0.0
    run.advance(here)
    assert here.paired.collecting is collecting


@pytest.mark.parametrize(("force_N", "ends"), [(0.79, False), (0.8, False), (0.81, True)])
def test_a_touch_ends_at_twice_the_force_that_was_detected(force_N: float, ends: bool) -> None:
    run, here = touching(19.5, force_N)
    assert run.advance(here) is False
    assert (run._phase == run._estimate) is ends


@pytest.mark.parametrize("found_mm", [20.0, 15.0])
def test_a_touch_goes_as_deep_as_the_detection(found_mm: float) -> None:
    run, here = touching(DETECTED_MM - 0.0004, found_mm=found_mm)
    run.advance(here)
    assert here.setpoint == Setpoint(DETECTED_MM, 0.0)
    assert run._phase == run._estimate


@pytest.mark.parametrize(
    ("position_mm", "force_N", "ends"), [(18.99, 0.3, False), (19.0, 0.2, False), (19.0, 0.21, True)]
)
def test_a_touch_goes_no_more_than_4_mm_past_the_surface_where_half_of_the_detected_force_is_felt(
    position_mm: float, force_N: float, ends: bool
) -> None:
    run, here = touching(position_mm, force_N, found_mm=15.0)
    assert run.advance(here) is False
    assert (run._phase == run._estimate) is ends
