"""What is drawn by chance has the covariance asked for, and does not hang on last digits."""

import numpy as np
import pytest

from rig.diagnosis.evidence import covariance_root


def test_the_root_of_a_covariance_is_that_of_the_textbook_unit_by_unit() -> None:
    # Correlation 1/2 has the eigenvalues 3/2 and 1/2 along (1, 1) and (1, -1).
    high, low = np.sqrt(1.5), np.sqrt(0.5)
    symmetric = 0.5 * np.array([[high + low, high - low], [high - low, high + low]])
    units = np.array([1.0, 1e-6])
    covariance = np.array([[1.0, 0.5], [0.5, 1.0]]) * np.outer(units, units)
    (root,) = covariance_root(covariance[None])
    assert root == pytest.approx(units[:, None] * symmetric, rel=1e-12)


def test_last_digits_of_a_covariance_do_not_turn_what_is_drawn() -> None:
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(50, 4)) * [1.0, 1e3, 1e-5, 1.0]
    alike, correlated = np.eye(4), rows.T @ rows
    for covariance in (alike, correlated):
        for _ in range(20):
            noise = 1e-13 * rng.normal(size=(4, 4)) * np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
            (root,), (moved,) = covariance_root(covariance[None]), covariance_root((covariance + noise + noise.T)[None])
            assert np.abs((moved - root) / np.sqrt(np.diag(covariance))[:, None]).max() < 1e-10
