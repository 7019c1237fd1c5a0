"""How much stiffer a layer on bone is than deep tissue: the factor kappa of Hayes et al. (1972), computed.

A rigid flat punch of radius a on an elastic layer of thickness h bonded to a rigid base: P = 2 a E w kappa / (1 -
nu^2). Hayes, Keer, Herrmann, Mockros, "A mathematical analysis for indentation tests of articular cartilage", J.
Biomech. 5 (1972) 541. Small strain only.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rig.errors import UsageError

_PUNCH_POINTS = 32
_WAVE_POINTS = 160
_LONGEST_WAVE = 40.0  # 1 - N falls like omega^2 exp(-2 omega)


def layer_factor(radius_over_thickness: float, poisson_ratio: float) -> float:
    """kappa(a/h, nu): 1 for a thick layer, larger the thinner it is; relative error below 1e-6 for a/h up to 3.

    The dual integral equations of the contact problem reduce to phi(t) - (1/pi) int_0^1 phi(s) [K(t-s) + K(t+s)] ds =
    1, K(u) = (a/h) int_0^inf (1 - N(w)) cos(w u a/h) dw, with N the layer's compliance over the half-space's; kappa =
    int_0^1 phi.
    """
    if not 0.0 < radius_over_thickness <= 3.0:
        raise UsageError(
            f"tip radius over tissue thickness is {radius_over_thickness:g}; it must lie above 0 and not above 3"
        )
    if not 0.0 <= poisson_ratio <= 0.5:
        raise UsageError(f"Poisson's ratio is {poisson_ratio:g}; it must lie between 0 and 0.5")
    return _solve(float(radius_over_thickness), float(poisson_ratio))


@lru_cache(maxsize=256)
def _solve(ratio: float, nu: float) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(_PUNCH_POINTS)
    t, w = 0.5 * (nodes + 1.0), 0.5 * weights
    kernel = _kernel(t[:, None] - t[None, :], ratio, nu) + _kernel(t[:, None] + t[None, :], ratio, nu)
    phi = np.linalg.solve(np.eye(len(t)) - kernel * w / np.pi, np.ones(len(t)))
    return float(w @ phi)


def _kernel(u: NDArray[np.float64], ratio: float, nu: float) -> NDArray[np.float64]:
    nodes, weights = np.polynomial.legendre.leggauss(_WAVE_POINTS)
    omega, w = 0.5 * _LONGEST_WAVE * (nodes + 1.0), 0.5 * _LONGEST_WAVE * weights
    missing = (1.0 - _compliance(omega, nu)) * w
    return np.asarray(ratio * np.cos(u[..., None] * omega * ratio) @ missing)


def _compliance(omega: NDArray[np.float64], nu: float) -> NDArray[np.float64]:
    """Surface compliance of the bonded layer over that of the half-space, per wave number times thickness."""
    c = 3.0 - 4.0 * nu
    return np.asarray(
        (c * np.sinh(2 * omega) - 2 * omega) / (c * np.cosh(2 * omega) + 2 * omega**2 + 5 - 12 * nu + 8 * nu**2)
    )


def punch_stiffness_N_mm(young_MPa: float, poisson_ratio: float, radius_mm: float, thickness_mm: float) -> float:
    """dP/dw in N/mm of a rigid flat punch on the layer at small depth."""
    factor = layer_factor(radius_mm / thickness_mm, poisson_ratio)
    return 2.0 * radius_mm * young_MPa * factor / (1.0 - poisson_ratio**2)
