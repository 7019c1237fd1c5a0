"""History operators as scans give what a loop over samples gives."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rig.simulation.scans import dahl, play
from rig.tissue.history import History, recurrence


def two_recordings(seed: int, count: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, time and starts of two recordings."""
    rng = np.random.default_rng(seed)
    first = np.zeros(count, bool)
    first[[0, count // 2]] = True
    return np.cumsum(rng.normal(size=count)), np.arange(count) * 0.01, first


@given(st.integers(0, 10_000))
def test_a_recurrence_equals_its_loop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    decay, source = rng.uniform(0, 1, 50), rng.normal(size=50)
    decay[[0, 20]] = 0
    state, looped = 0.0, []
    for a, b in zip(decay, source, strict=True):
        state = a * state + b
        looped.append(state)
    np.testing.assert_allclose(recurrence(decay, source), looped, atol=1e-12)


def test_of_several_signals_each_relaxes_as_by_itself() -> None:
    time_s, rng = np.cumsum(np.random.default_rng(1).uniform(0.002, 0.006, 300)), np.random.default_rng(2)
    history, signals = History.at(time_s, time_s), rng.normal(size=(600, 3))
    together = history.transient(signals, 0.05)
    for signal, found in zip(signals.T, together.T, strict=True):
        np.testing.assert_allclose(found, history.transient(signal, 0.05), rtol=0, atol=1e-15)


@given(st.integers(0, 10_000), st.floats(0.01, 5))
def test_play_equals_its_loop_and_never_leaves_the_dead_band(seed: int, width: float) -> None:
    position, _, first = two_recordings(seed)
    looped, follower = [], 0.0
    for x, begins in zip(position, first, strict=True):
        follower = x if begins else min(max(follower, x), x + width)
        looped.append(follower)
    tip = play(position, first, width)
    np.testing.assert_allclose(tip, looped, atol=1e-12)
    assert np.all(tip >= position - 1e-12)
    assert np.all(tip <= position + width + 1e-12)


def test_dahl_friction_builds_up_over_its_length_and_turns_after_a_reversal() -> None:
    position = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 0, 101)[1:]])
    first = np.zeros(201, bool)
    first[0] = True
    state = dahl(position, first, 0.1)
    np.testing.assert_allclose(state[10], 1 - np.exp(-1), atol=1e-12)
    assert state[100] > 0.999
    assert state[200] < -0.999
    # Begun where a way out left the guide, all of the change comes once more.
    left = dahl(position, first, 0.1, -1.0)
    assert left[0] == -1.0
    np.testing.assert_allclose(left - state, -np.exp(-np.cumsum(np.abs(np.diff(position, prepend=0.0))) / 0.1))


def test_relaxation_of_a_ramp_is_the_textbook_exponential_in_every_path_anew() -> None:
    time_s, tau_s = np.arange(1000) * 1e-3, 0.2
    ramps = History.at(time_s, time_s).transient(np.tile(time_s, 2), tau_s)
    np.testing.assert_allclose(ramps, np.tile(tau_s * (1 - np.exp(-time_s / tau_s)), 2), atol=1e-12)
