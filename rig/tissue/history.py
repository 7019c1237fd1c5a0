"""Relaxation: what a path of the tip through time leaves of earlier force (Fung's hereditary integral).

With elastic force e(t) and relaxation 1 + sum r_i exp(-t/tau_i), force is F = e + sum r_i q_i with q_i the integral of
exp(-(t-s)/tau_i) de(s). Where e goes straight from sample to sample that is exact in steps: q <- exp(-h/tau) q +
(tau/h)(1 - exp(-h/tau)) (e_new - e_old), unconditionally stable (Taylor, Pister, Goudreau 1970; Simo, Hughes 1998).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rig.errors import UsageError
from rig.remembered import exp, remembered

FloatArray = NDArray[np.float64]
SMALLEST = np.finfo(float).tiny
FORGOTTEN = 40.0  # times of relaxation: exp(-40) is lost in double precision
# Of a shorter step 1 - exp(-h/tau) has fewer than ten digits; of longer ones fixed sessions keep it to the last digit.
SUDDEN = 1e-6
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)


class Term(NamedTuple):
    """One term of the relaxation: force it adds to the force at rest in a sudden move, as a ratio, and its time."""

    ratio: float
    tau_s: float


@dataclass(frozen=True)
class History:
    """Makes depths given with it one path, or several end to end: seconds since the depth before, shape (n,).

    A step of inf begins a path, with tissue that has been at rest. Between samples the elastic force runs straight.
    """

    step_s: FloatArray

    def __post_init__(self) -> None:
        if not np.all(self.step_s > 0):
            at = int(np.argmin(self.step_s > 0))
            raise UsageError(
                f"a history needs times that rise: sample {at + 1} comes {self.step_s[at]:g} s after the one before; "
                "sort or remove samples"
            )

    @classmethod
    def at(cls, *times_s: ArrayLike) -> Self:
        """The history of paths sampled at these times, each shape (n_i,)."""
        return cls(np.concatenate([np.diff(np.asarray(time, float), prepend=-np.inf) for time in times_s]))

    def respond(self, elastic_N: FloatArray, terms: Sequence[Term]) -> FloatArray:
        """Force [N] with relaxation along the path, from the force at rest there, shape (n,)."""
        if elastic_N.shape != self.step_s.shape:
            raise UsageError(
                f"{len(self.step_s)} times for {elastic_N.size} depths; a history has one time for each depth"
            )
        left_N = (ratio * self.transient(elastic_N, tau_s) for ratio, tau_s in terms)
        return elastic_N + sum(left_N, np.zeros_like(elastic_N))

    @remembered
    def transient(self, signal: FloatArray, tau_s: float) -> FloatArray:
        """What is left of signals' changes, which die out with ``tau_s``: q above, same shape; signal - q lags it."""
        decay, sudden = exp(-self.step_s / tau_s), self.step_s < SUDDEN * tau_s
        lost = 1 - decay
        lost[sudden] = -np.expm1(-self.step_s[sudden] / tau_s)
        return recurrence(decay, (lost * tau_s / self.step_s * np.diff(signal, axis=0, prepend=signal[:1]).T).T)


def recurrence(decay: FloatArray, source: FloatArray) -> FloatArray:
    """y[n] = decay[n] y[n-1] + source[n], from y = 0; a decay of 0 begins anew. Of a source (n,) or several (n, k)."""
    from scipy.linalg.lapack import dtbtrs  # noqa: PLC0415 - a law without memory does not wait for it

    # The sources are a triangular matrix of two diagonals times what is wanted.
    band = np.stack([np.ones_like(decay), np.append(-decay[1:], 0.0)])
    return np.asarray(dtbtrs(band, source, uplo="L", diag="U")[0], float)


def ramped(
    slope: Callable[[FloatArray], FloatArray], depth_mm: FloatArray, rate_mm_s: FloatArray, terms: Sequence[Term]
) -> FloatArray:
    """What relaxation adds [N] at depths reached from contact at one speed each; ``slope`` is that of elastic force.

    sum r_i int_0^x exp(-u/(v tau_i)) slope(x-u) du, by Gauss and Legendre over what is not forgotten.
    """
    total = np.zeros_like(depth_mm)
    for ratio, tau_s in terms:
        length_mm = np.maximum(rate_mm_s * tau_s, SMALLEST)
        back_mm = np.minimum(depth_mm, FORGOTTEN * length_mm)
        ago_mm = 0.5 * back_mm[..., None] * (1.0 + _NODES)
        kept = np.exp(-ago_mm / length_mm[..., None]) * slope(np.maximum(depth_mm[..., None] - ago_mm, 0.0))
        total = total + 0.5 * ratio * back_mm * (kept @ _WEIGHTS)
    return total
