"""Where the surface lies in recordings without air before the loading: the interval holds it, or the reason is said."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from rig.errors import DataError
from rig.trials.surface import FoundSurface, find_surface
from tests.rig.tissue.synthetic import Bench
from tests.rig.trials.preloaded import LAWS, SENSORS, SURFACE_MM, preloaded


@pytest.mark.parametrize("sensor", SENSORS)
def test_the_interval_holds_the_surface_whatever_law_the_tissue_obeys(sensor: str) -> None:
    found = [_found(law, sensor, seed) for law, seed in product(LAWS, range(8))]
    held = [f.contact.lower_mm <= SURFACE_MM <= f.contact.upper_mm for f in found if f]
    assert len(held) >= 25
    assert held.count(False) <= 0.05 * len(held)


def _found(law: str, sensor: str, seed: int) -> FoundSurface | None:
    try:
        return find_surface(preloaded(law, SENSORS[sensor], seed))
    except DataError as refusal:
        assert "started in contact" in str(refusal)
        return None


def test_friction_that_a_guide_builds_up_is_air_all_the_same() -> None:
    cycle = Bench(noise_N=0.002).cycle(10.0)
    gone_mm = cycle.position_mm - cycle.position_mm.min()
    surface = find_surface(replace(cycle, force_N=cycle.force_N + 0.15 * -np.expm1(-gone_mm / 0.2)))
    assert not surface.findings
    assert surface.contact.lower_mm <= SURFACE_MM <= surface.contact.upper_mm


def test_zero_is_that_of_the_air_after_the_loading() -> None:
    cycle = preloaded("linear", SENSORS["bota"], 1)
    raised = find_surface(replace(cycle, force_N=cycle.force_N + 0.7))
    assert raised.cycle.force_N == pytest.approx(cycle.force_N, abs=0.002)
    assert "the air after the loading" in raised.findings[0].text


def test_without_air_at_all_zero_is_the_recordings_own() -> None:
    surface = find_surface(preloaded("linear", SENSORS["bota"], 0))
    assert "started in contact" in surface.findings[0].text
    assert "the recording's own zero" in surface.findings[0].text


def test_a_preload_of_a_third_of_the_peak_is_refused_as_started_in_contact() -> None:
    cycle = Bench(zero_N=0.0).cycle(10.0)
    start = int(np.flatnonzero(cycle.position_mm > 25.0)[0])
    pressed = replace(
        cycle, time_s=cycle.time_s[start:], force_N=cycle.force_N[start:], position_mm=cycle.position_mm[start:]
    )
    with pytest.raises(DataError, match=r"started in contact.*start higher"):
        find_surface(pressed)


def test_a_force_below_zero_makes_zero_as_uncertain_as_it_is_wrong() -> None:
    cycle = preloaded("linear", SENSORS["bota"], 0)
    right, wrong = (find_surface(replace(cycle, force_N=cycle.force_N - off_N)).contact for off_N in (0.0, 0.01))
    assert wrong.upper_mm - wrong.lower_mm > 1.5 * (right.upper_mm - right.lower_mm)
