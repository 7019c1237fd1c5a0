"""Where the surface lies in recordings without air before the loading: the interval holds it, or the reason is said."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from mock_devices.testing.made.preloaded import LAWS, OTHER_LAWS, SENSORS, SURFACE_MM, preloaded, stepped, uneven
from mock_devices.testing.made.synthetic import Bench
from rig.errors import DataError
from rig.trials import contact as contact_search
from rig.trials.cycles import IndentationCycle
from rig.trials.surface import FoundSurface, find_surface


@pytest.mark.parametrize("sensor", SENSORS)
def test_the_interval_holds_the_surface_whatever_law_the_tissue_obeys(sensor: str) -> None:
    found = [_found(law, sensor, seed) for law, seed in product(LAWS, range(3))]
    held = [f.contact.lower_mm <= SURFACE_MM <= f.contact.upper_mm for f in found if f]
    assert len(held) >= 12
    # At 95 %, more than two of 21 outside has a chance of 8 %; the seeds are fixed, the benchmark has the share.
    assert held.count(False) <= 2


@pytest.mark.parametrize("sensor", SENSORS)
def test_after_air_the_interval_holds_the_surface_of_laws_that_the_estimator_does_not_contain(sensor: str) -> None:
    loadings = [preloaded(law, SENSORS[sensor], seed, air_mm=3.0) for seed, law in enumerate((*LAWS, *OTHER_LAWS))]
    contacts = [find_surface(loading).contact for loading in loadings]
    # At 95 %, more than two of twelve outside has a chance of 2 %.
    assert sum(contact.low_mm <= SURFACE_MM <= contact.high_mm for contact in contacts) >= 10
    # Known as well as a good trial asks for, twice as well with a sensor of a study.
    assert np.median([contact.high_mm - contact.low_mm for contact in contacts]) < {"cell": 0.4}.get(sensor, 0.2)


def held(law: str, sensor: str, seeds: range) -> int:
    contacts = [find_surface(preloaded(law, SENSORS[sensor], seed, air_mm=3.0)).contact for seed in seeds]
    return sum(contact.low_mm <= SURFACE_MM <= contact.high_mm for contact in contacts)


@pytest.mark.parametrize("sensor", SENSORS)
def test_after_air_the_interval_holds_the_surface_under_a_sphere_and_of_two_layers(sensor: str) -> None:
    # At 95 %, more than two of twelve outside has a chance of 2 %.
    assert sum(held(law, sensor, range(200, 206)) for law in ("sphere (Hertz)", "two layers")) >= 10


def test_an_interval_of_all_of_a_loading_that_does_not_fit_would_miss_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contact_search, "PROBABLE", 0.5)
    monkeypatch.setattr(contact_search, "_union", lambda found, _: found)
    monkeypatch.setattr(contact_search.ContactSearch, "fits", True)
    assert sum(held(law, "cell", range(200, 206)) for law in ("sphere (Hertz)", "two layers")) < 10


@pytest.mark.parametrize("law", ["linear", "index", "power 1.25"])
def test_a_gap_about_the_surface_is_in_the_interval(law: str) -> None:
    contact = find_surface(uneven(law, SENSORS["ft300"], 1)).contact
    assert contact.low_mm <= SURFACE_MM <= contact.high_mm


def test_little_air_that_is_air_for_certain_is_air_all_the_same() -> None:
    surface = find_surface(uneven("power 2.25", SENSORS["cell"], 0))
    assert not surface.findings
    assert surface.contact.low_mm <= SURFACE_MM <= surface.contact.high_mm


@pytest.mark.parametrize("law", ["linear", "Fung", "yielding"])
def test_a_motion_in_steps_tells_the_surface(law: str) -> None:
    contact = find_surface(stepped(law, SENSORS["cell"], 1)).contact
    assert contact.low_mm <= SURFACE_MM <= contact.high_mm
    assert contact.high_mm - contact.low_mm < 1.0


def test_a_single_sample_after_the_peak_is_no_air() -> None:
    cycle = preloaded("linear", SENSORS["bota"], 0)
    peak = int(np.argmax(cycle.force_N))
    cut = replace(
        cycle, time_s=cycle.time_s[: peak + 1], force_N=cycle.force_N[: peak + 1],
        position_mm=cycle.position_mm[: peak + 1],
    )  # fmt: skip
    assert "the recording's own zero" in find_surface(cut).findings[0].text


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


def test_a_sensor_that_is_full_has_its_peak_on_the_way_in() -> None:
    cycle = Bench(noise_N=0.002).cycle(10.0)
    turn, top_N = int(np.argmax(cycle.position_mm)), float(cycle.force_N.max())
    full_N = np.where(np.arange(len(cycle.force_N)) >= turn, top_N, np.minimum(cycle.force_N, 0.6 * top_N))
    full_N[turn + 600] = top_N + 0.001
    surface = find_surface(replace(cycle, force_N=full_N))
    assert cycle.position_mm[surface.rise.peak] == pytest.approx(28.0, abs=0.01)


def test_a_preload_that_nothing_grows_from_is_refused_for_that() -> None:
    random = np.random.default_rng(1)
    way_mm = np.linspace(0.0, 1.0, 500)
    force_N = 0.5 + 0.2 * way_mm + 0.002 * random.standard_normal(500)
    cycle = IndentationCycle("clamped", float("nan"), np.linspace(0.0, 5.0, 500), np.asarray(force_N), way_mm)
    with pytest.raises(DataError, match=r"started in contact, at 0.5 N where zero is 0 N: force grows too little more"):
        find_surface(cycle)


def test_a_preload_lies_as_far_below_the_surface_as_the_growth_of_force_says() -> None:
    """1 mm on linear tissue, 2 mm where half of the preload had relaxed; by a threefold growth alone up to 5.2 mm."""
    random = np.random.default_rng(2)
    way_mm = np.concatenate([np.zeros(50), np.linspace(0.0, 12.0, 3000)])
    force_N = 0.3 * (1.0 + way_mm) + 0.002 * random.standard_normal(len(way_mm))
    cycle = IndentationCycle("pressed", float("nan"), np.linspace(0.0, 6.0, 3050), np.asarray(force_N), way_mm)
    contact = find_surface(cycle).contact
    assert -3.0 < contact.low_mm < -2.0
    assert 0.0 <= contact.high_mm < 0.05


def test_a_force_below_zero_makes_zero_as_uncertain_as_it_is_wrong() -> None:
    cycle = preloaded("linear", SENSORS["bota"], 0)
    right, wrong = (find_surface(replace(cycle, force_N=cycle.force_N - off_N)).contact for off_N in (0.0, 0.01))
    assert wrong.upper_mm - wrong.lower_mm > 1.5 * (right.upper_mm - right.lower_mm)
