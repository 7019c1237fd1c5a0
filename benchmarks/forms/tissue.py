"""Tissue: forces of elastic laws [N] for depths of at least 0 [mm], what the past does to them, and softening.

All arrays of a session have shape (steps, recordings). Lasting force is that of the elastic law; what relaxes comes on
top of it, by Fung's quasi-linear hereditary integral (Fung 1993, Biomechanics, 7.6).
"""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.signal import fftconvolve, lfilter
from scipy.special import erf

Array = NDArray[np.float64]
Law = Callable[[Array], Array]
DEEPEST_MM = 15.0  # no stroke goes half as deep


def flat_punch(k_N_mm: float) -> Law:
    """A flat-ended cylinder on a half-space, F = k x (Sneddon 1965)."""
    return lambda x: k_N_mm * x


def fung(k_N_mm: float, b_per_mm: float) -> Law:
    """Stiffness that grows with force, dF/dx = k + b F (Fung 1967)."""
    return lambda x: k_N_mm / b_per_mm * np.expm1(b_per_mm * x)


def ogden_block(k_N_mm: float, thickness_mm: float, alpha: float) -> Law:
    """An incompressible block of one Ogden term in uniaxial compression (Ogden 1972); k is its slope at no strain."""

    def force(x: Array) -> Array:
        stretch = 1 - x / thickness_mm
        stress = stretch ** (-alpha / 2 - 1) - stretch ** (alpha - 1)
        return np.asarray(k_N_mm * thickness_mm * 2 / (3 * alpha) * stress)

    return force


def thin_layer(modulus_MPa: float, radius_mm: float, thickness_mm: float) -> Law:
    """A sphere on an incompressible layer bonded to something rigid (Dimitriadis and others 2002, eq. 12)."""

    def force(x: Array) -> Array:
        chi = np.sqrt(radius_mm * x) / thickness_mm
        rise = 1 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4
        return np.asarray(16 / 9 * modulus_MPa * np.sqrt(radius_mm) * x**1.5 * rise)

    return force


def neo_hookean_sphere(b_MPa: float, radius_mm: float) -> Law:
    """A sphere on neo-Hookean material: stress at the stretch 1 - 0.2 a/R, a^2 = R x (Lin and others 2009)."""

    def force(x: Array) -> Array:
        stretch = 1 - 0.2 * np.sqrt(x / radius_mm)
        return np.asarray(b_MPa * radius_mm * x * (stretch**-2 - stretch))

    return force


def remember_exponentials(force_N: Array, step_s: float, shares: Iterable[float], taus_s: Iterable[float]) -> Array:
    """With a Prony series on top; exact for a force that is straight within each step."""
    rise = np.diff(force_N, axis=0, prepend=force_N[:1])
    for share, tau_s in zip(shares, taus_s, strict=True):
        kept = np.exp(-step_s / tau_s)
        force_N = force_N + np.asarray(lfilter([share * tau_s / step_s * (1 - kept)], [1.0, -kept], rise, axis=0))
    return force_N


def remember(force_N: Array, step_s: float, kernel: Callable[[Array], Array]) -> Array:
    """With a transient on top that fades as ``kernel`` of the time since each rise [s]."""
    rise = np.diff(force_N, axis=0, prepend=force_N[:1])
    since_s: Array = (np.arange(len(force_N), dtype=np.float64) + 0.5) * step_s
    fading: Array = fftconvolve(rise, kernel(since_s)[:, None], axes=0)
    return force_N + fading[: len(force_N)]


def power_law(share: float, begin_s: float, exponent: float) -> Callable[[Array], Array]:
    """share (1 + t/begin)^-exponent: fractional memory, all times at once (Schapery 1969; Bonfanti and others 2020)."""
    return lambda t: share * (1 + t / begin_s) ** -exponent


def poroelastic(share: float, tau_s: float) -> Callable[[Array], Array]:
    """Fluid leaving below a sphere; tau is contact radius squared over diffusivity (Hu and others 2010)."""
    return lambda t: share * (0.491 * np.exp(-0.908 * np.sqrt(t / tau_s)) + 0.509 * np.exp(-1.679 * t / tau_s))


def soften_by_energy(force_N: Array, depth_mm: Array, site: Array, law: Law, r: float, m: float) -> Array:
    """Mullins' effect: below the site's largest strain energy force is less (Ogden and Roxburgh 1999).

    ``m`` is in shares of the energy at a depth of 5 mm.
    """
    grid = np.linspace(0, DEEPEST_MM, 2000)
    energy = cumulative_trapezoid(law(grid), grid, initial=0)
    own = np.interp(np.maximum(depth_mm, 0), grid, energy)
    m_N_mm, largest, softer = m * float(np.interp(5.0, grid, energy)), dict[int, float](), np.empty_like(force_N)
    for k, at in enumerate(site):
        most = np.maximum(np.maximum.accumulate(own[:, k]), largest.get(int(at), 0.0))
        softer[:, k] = force_N[:, k] * (1 - erf((most - own[:, k]) / m_N_mm) / r)
        largest[int(at)] = float(most[-1])
    return softer


def counts_on_site(site: Array) -> Array:
    """How many recordings of the same site came before each, shape (recordings,)."""
    return np.array([np.count_nonzero(site[:k] == at) for k, at in enumerate(site)], float)
