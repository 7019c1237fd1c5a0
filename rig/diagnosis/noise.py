"""Coloured noise and chance differences between recordings, estimated from a model's own residuals.

Per recording r ~ N(0, s^2 R_AR(p) + U D U'), U being the finite change (secant, because contact has a kink) of the
prediction with each scattering quantity. Whitening is the AR filter, then the inverse square root of I + U D U'.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]
LARGEST_ORDER = 6  # 24 ms at 250 Hz: longer than derivatives (16 ms) and the filters of force sensors
EM_STEPS = 25
SMALLEST_SD = 1e-12  # no sensor resolves it in N, mm or m; exact data keep a logarithm


@dataclass(frozen=True)
class Colour:
    """Autoregressive noise of one channel: coefficients, shape (order,), and standard deviation of innovations."""

    ar: Array
    sd: float

    def whiten(self, rows: Array, keep: Mask) -> Array:
        """``rows`` (n,) or (n, k) filtered to unit innovations; rows that cannot be judged become 0."""
        out = rows.copy()
        for lag, coefficient in enumerate(self.ar, start=1):
            out[lag:] -= coefficient * rows[:-lag]
        out[~keep] = 0.0
        return out / self.sd


@dataclass(frozen=True)
class Noise:
    """Colours of all channels; of the first channel the scatter (k,) and each recording's shifts (recordings, k)."""

    colours: tuple[Colour, ...]
    scatter_sd: Array
    shifts: Array


def starts_of(recording: Index, recordings: int) -> Index:
    """First row of each recording and the total, shape (recordings + 1,)."""
    return np.searchsorted(recording, np.arange(recordings + 1)).astype(np.int64)


def estimate_colour(residual: Array, starts: Index, blind: Mask | None = None, memory: float = float("inf")) -> Colour:
    """Order by BIC up to 6, least squares on lagged rows that lie inside one recording and see no blind row.

    All poles are drawn in by exp(-1 / memory), so that nothing slower than ``memory`` samples passes for noise.
    """
    lagged, target = _lagged(residual, starts, blind)
    if len(target) <= 4 * LARGEST_ORDER:
        return Colour(np.empty(0), max(float(np.sqrt(np.mean(residual**2))), SMALLEST_SD))
    cross, products = lagged.T @ target, lagged.T @ lagged
    total = float(target @ target)
    chosen, lowest = np.empty(0), np.inf
    for order in range(LARGEST_ORDER + 1):
        ar = np.linalg.lstsq(products[:order, :order], cross[:order], rcond=None)[0] if order else np.empty(0)
        unexplained = max(total - float(ar @ cross[:order]), 1e-12 * total, 1e-300)
        criterion = len(target) * np.log(unexplained) + order * np.log(len(target))
        if criterion < lowest - 1e-9:
            chosen, lowest = np.asarray(ar, float), float(criterion)
    chosen = chosen * np.exp(-np.arange(1, len(chosen) + 1) / memory)
    left = target - lagged[:, : len(chosen)] @ chosen
    return Colour(chosen, max(float(np.sqrt(np.mean(left**2))), SMALLEST_SD))


def judged(count: int, starts: Index, order: int, blind: Mask | None = None) -> Mask:
    """Rows whose innovation can be formed: ``order`` rows of history, none of them blind, shape (count,)."""
    keep = np.ones(count, bool)
    for begin in starts[:-1]:
        keep[begin : begin + order] = False
    for lag in range(order + 1 if blind is not None else 0):
        keep[lag:] &= ~blind[: count - lag]  # type: ignore[index]
    return keep


def _lagged(residual: Array, starts: Index, blind: Mask | None) -> tuple[Array, Array]:
    rows = np.flatnonzero(judged(len(residual), starts, LARGEST_ORDER, blind))
    return np.stack([residual[rows - lag] for lag in range(1, LARGEST_ORDER + 1)], axis=1), residual[rows]


def estimate_scatter(white: Array, secants: Array, starts: Index, start_sd: Array) -> tuple[Array, Array]:
    """Standard deviations (k,) by expectation-maximisation, and each recording's best values (recordings, k).

    ``white`` (n,) and ``secants`` (n, k) are AR-whitened. The factor R / (R - 1) undoes the fitted mean.
    """
    blocks = list(pairwise(starts))
    gram = np.stack([secants[i:j].T @ secants[i:j] for i, j in blocks])
    cross = np.stack([secants[i:j].T @ white[i:j] for i, j in blocks])
    variance = np.maximum(start_sd, SMALLEST_SD) ** 2
    correction = len(blocks) / max(len(blocks) - 1, 1)
    mean = np.zeros_like(cross)
    for _ in range(EM_STEPS):
        posterior = np.linalg.inv(gram + np.diag(1 / variance))
        mean = np.einsum("rij,rj->ri", posterior, cross)
        spread = (mean**2).sum(axis=0) * correction + np.einsum("rii->i", posterior)
        variance = np.maximum(spread / len(blocks), SMALLEST_SD**2)
    return np.sqrt(variance), mean


@dataclass(frozen=True)
class ScatterWhitener:
    """Inverse square root of I + U D U' per recording, and its share of the log determinant, shape (recordings,)."""

    bases: tuple[Array, ...]
    shrink: tuple[Array, ...]
    log_det: Array
    starts: Index

    @classmethod
    def of(cls, secants: Array, sd: Array, starts: Index) -> "ScatterWhitener":
        """From AR-whitened secants (n, k)."""
        bases, shrink, log_det = [], [], []
        for begin, end in pairwise(starts):
            left, singular, _ = np.linalg.svd(secants[begin:end] * sd, full_matrices=False)
            bases.append(left)
            shrink.append(1 - 1 / np.sqrt(1 + singular**2))
            log_det.append(-0.5 * float(np.log1p(singular**2).sum()))
        return cls(tuple(bases), tuple(shrink), np.array(log_det), starts)

    def __call__(self, rows: Array) -> Array:
        """``rows`` (n,) or (n, k) with the scatter's directions shrunk."""
        out = rows.copy()
        for base, shrink, begin, end in zip(self.bases, self.shrink, self.starts[:-1], self.starts[1:], strict=True):
            weight = shrink if rows.ndim == 1 else shrink[:, None]
            out[begin:end] -= base @ (weight * (base.T @ rows[begin:end]))
        return out
