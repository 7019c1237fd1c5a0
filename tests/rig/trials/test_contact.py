"""The change point, on loadings whose contact is known: the interval holds it, whatever the tissue and the sensor."""

import numpy as np
import pytest
from scipy.optimize import nnls

from rig.trials.contact import (
    ANY_SHAPE,
    CANDIDATES,
    LIMB_SHAPE,
    POWERS,
    Contact,
    ContactSearch,
    Family,
    Loading,
    Misfits,
    _onsets,
    find_contact,
)

SURFACE_MM = 20.0
BOTA, FT300_SLOW = (0.005, 0.005), (0.05, 0.005)
LEVEL_N = 0.31


def loading(
    a_N_mm: float, b_per_mm: float, jump_N: float, noise_N: float, apart_mm: float, to_N: float, seed: int
) -> Loading:
    """Two millimetres of air at a level of its own, then the study's law up to a force."""
    random = np.random.default_rng(seed)
    depth = np.arange(-2.0 - apart_mm * random.random(), 12.0, apart_mm)
    force = np.where(depth > 0, a_N_mm * depth * np.exp(b_per_mm * depth) + jump_N, 0.0)
    kept = slice(0, int(np.argmax(force > to_N)) + 3)
    sensed = LEVEL_N + force[kept] + noise_N * random.standard_normal(len(force[kept]))
    return Loading(SURFACE_MM + depth[kept], sensed, np.ones(len(sensed)))


def found(of: Loading, noise_N: float) -> Contact:
    search_mm = (float(of.position_mm[0]) + 0.3, float(of.position_mm[-1]))
    search = ContactSearch(of, search_mm, noise_N, LIMB_SHAPE, rounds=3)
    while not search.advance():
        pass
    return search.contact


@pytest.mark.parametrize(("noise_N", "apart_mm"), [BOTA, FT300_SLOW])
@pytest.mark.parametrize(
    ("a_N_mm", "b_per_mm", "jump_N"),
    [(0.12, 0.22, 0.0), (0.12, 0.22, 0.05), (0.05, 0.0, 0.0), (0.5, 0.2, 0.0), (5.0, 0.0, 0.1), (1.0, 0.3, 0.025)],
)
def test_the_interval_holds_the_contact_in_nineteen_of_twenty(
    a_N_mm: float, b_per_mm: float, jump_N: float, noise_N: float, apart_mm: float
) -> None:
    loadings = [loading(a_N_mm, b_per_mm, jump_N, noise_N, apart_mm, 10 * noise_N, seed) for seed in range(12)]
    contacts = [found(one, noise_N) for one in loadings]
    # At 95 %, more than three of twelve outside has a chance of 0.2 %.
    assert sum(contact.low_mm <= SURFACE_MM <= contact.high_mm for contact in contacts) >= 9
    assert all(contact.lower_mm - 0.05 <= SURFACE_MM <= contact.upper_mm + 0.05 for contact in contacts)
    errors = np.array([contact.position_mm - SURFACE_MM for contact in contacts])
    assert np.abs(errors).max() < max(0.05, 3 * np.median([contact.deviation_mm for contact in contacts]))


def test_noise_makes_the_interval_wider_and_does_not_move_the_contact() -> None:
    quiet, noisy = (
        [found(loading(0.5, 0.2, 0.0, noise_N, 0.005, 0.5, seed), noise_N) for seed in range(10)]
        for noise_N in (0.005, 0.05)
    )
    assert np.mean([contact.position_mm for contact in noisy]) == pytest.approx(SURFACE_MM, abs=0.05)
    assert np.mean([contact.position_mm for contact in quiet]) == pytest.approx(SURFACE_MM, abs=0.02)
    assert np.mean([c.within_mm for c in noisy]) > 2 * np.mean([c.within_mm for c in quiet])


def test_rows_of_several_readings_count_as_many() -> None:
    each = loading(0.5, 0.2, 0.0, 0.02, 0.005, 0.5, 1)
    pairs = len(each.force_N) // 2
    position, force = (column[: 2 * pairs].reshape(-1, 2).mean(axis=1) for column in each[:2])
    mean = Loading(position, force, np.full(pairs, 2.0))
    single, double = found(each, 0.02), found(mean, 0.02)
    assert double.position_mm == pytest.approx(single.position_mm, abs=0.02)
    assert double.within_mm == pytest.approx(single.within_mm, rel=0.3)


def test_a_stroke_that_was_levelled_is_searched_at_once() -> None:
    position = np.linspace(8.0, 12.0, 401)
    force = np.where(position >= 10.0, 0.3 + 0.2 * (position - 10.0), 0.0)
    contact = find_contact(position, force, (8.5, 10.1), noise_N=1e-4)
    assert contact.position_mm == pytest.approx(10.0, abs=0.02)
    assert contact.low_mm < 10.0 < contact.high_mm


def test_misfits_are_those_of_both_fits_by_themselves() -> None:
    of = loading(0.12, 0.22, 0.05, 0.005, 0.005, 1.0, 4)
    search = ContactSearch(of, (float(of.position_mm[0]) + 0.3, float(of.position_mm[-1])), 0.005)
    jumps = set()
    for candidate in range(CANDIDATES):
        columns, force = search._centred(candidate, *ANY_SHAPE)
        level, jumped = nnls(columns[:, :-1], force), nnls(columns, force)
        jumps.add(bool(jumped[0][-1]))
        assert search._misfit(candidate, *ANY_SHAPE) == pytest.approx((level[1] ** 2, jumped[1] ** 2), rel=1e-9)
    assert jumps == {True, False}


def test_the_shapes_of_an_onset_begin_with_the_powers_of_depth() -> None:
    depth_mm = np.linspace(0.0, 3.0, 50)
    assert _onsets(depth_mm)[:, : len(POWERS)] == pytest.approx((depth_mm / 3.0)[:, None] ** POWERS)


def test_a_search_with_another_zero_finds_the_same_without_trying_again(monkeypatch: pytest.MonkeyPatch) -> None:
    of, tried = loading(0.12, 0.22, 0.05, 0.005, 0.005, 1.0, 4), list[int]()
    search_mm, misfit = (float(of.position_mm[0]) + 0.3, SURFACE_MM + 0.3), ContactSearch._misfit

    def counted(search: ContactSearch, candidate: int, family: Family) -> tuple[float, float]:
        tried.append(candidate)
        return misfit(search, candidate, family)

    monkeypatch.setattr(ContactSearch, "_misfit", counted)
    known: dict[tuple[int, int], Misfits] = {}
    find_contact(of.position_mm, of.force_N - LEVEL_N - 0.001, search_mm, 0.0052, known)
    first = len(tried)
    again = find_contact(of.position_mm, of.force_N - LEVEL_N, search_mm, 0.005, known)
    assert len(tried) - first < 0.1 * first
    assert again == pytest.approx(find_contact(of.position_mm, of.force_N - LEVEL_N, search_mm, 0.005), rel=1e-9)
