"""Where periodic causes are looked for: the transform against its sum, and in hours of recordings."""

import numpy as np

from rig.diagnosis.effects.scan import PEAKS, peaks


def test_the_peaks_are_those_of_the_sum_itself() -> None:
    rng = np.random.default_rng(1)
    at, grid = np.sort(rng.uniform(3, 40, 500)), np.arange(0.08, 3.0, 0.02)
    match = rng.standard_normal(500) + 3 * np.sin(2 * np.pi * 0.9 * at)
    width = 1 / (8 * grid[-1])
    middle = (np.floor((at - at[0]) / width) + 0.5) * width
    power = np.abs(np.exp(-2j * np.pi * np.outer(grid, middle)) @ match)
    inner = [k for k in range(1, len(grid) - 1) if power[k] == power[k - 1 : k + 2].max()]
    expected = sorted(inner, key=lambda k: -power[k])[:PEAKS]
    assert peaks(at, match, 1.0, grid) == [grid[k] for k in expected]


def test_two_hours_are_scanned_in_little_memory() -> None:
    """As a matrix that would be 42,000 frequencies of 173,000 bins: 116 GB."""
    at = np.arange(0, 7200, 0.04)
    grid = np.arange(0.08, 3.0, 0.5 / 7200)
    found = peaks(at, np.cos(2 * np.pi * 0.3 * at), 1.0, grid)
    assert abs(found[0] - 0.3) < 0.5 / 7200


def test_one_frequency_is_its_own_peak() -> None:
    assert peaks(np.linspace(0, 9, 50), np.ones(50), 1.0, np.array([0.5])) == [0.5]
