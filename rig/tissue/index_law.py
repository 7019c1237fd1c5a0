"""The index law and its extensions as functions of arrays: laws, simulation and diagnosis all call these.

A parameter is one number, or an array that goes with the depths where it differs between recordings.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rig.remembered import exp

FloatArray = NDArray[np.float64]
Fields = Mapping[str, float | FloatArray]
REFERENCE_MM = 5.0
# exp(30) is 1e13: a search that tries such a growth is told so by a number that can still be squared and summed.
LARGEST_EXPONENT = 30.0
# A power below one has an infinite slope at contact; a nanometre is far below what any encoder resolves.
SMALLEST_MM = 1e-6
LARGEST_STRAIN = 0.95  # of a block: a search that would squeeze it to nothing is told so by a number


def index_stiffness(depth_mm: FloatArray, a_N_mm: float | FloatArray, b_per_mm: float | FloatArray) -> FloatArray:
    """The study's secant stiffness k(x) = a exp(b x) [N/mm], same shape."""
    return np.asarray(a_N_mm * exp(np.minimum(b_per_mm * depth_mm, LARGEST_EXPONENT)))


def index_force(depth_mm: FloatArray, a_N_mm: float | FloatArray, b_per_mm: float | FloatArray) -> FloatArray:
    """a x exp(b x) [N] for depths >= 0, same shape."""
    return index_stiffness(depth_mm, a_N_mm * depth_mm, b_per_mm)


def extended_force(depth_mm: FloatArray, values: Fields) -> FloatArray:
    """The index law times (x / 5 mm)^(n-1), 1 + q x, 1 + s x^3 and other laws' forms where these are off their null.

    In N, for depths >= 0. ``bend`` over ``bend_mm`` is a curve of depth to bend any of them by, which no law has.
    """
    force_N = index_force(depth_mm, values["a_N_mm"], values["b_per_mm"])
    if values["exponent"] != 1:
        force_N = force_N * (np.maximum(depth_mm, SMALLEST_MM) / REFERENCE_MM) ** (values["exponent"] - 1)
    if values["quadratic_per_mm"]:
        force_N = force_N * (1 + values["quadratic_per_mm"] * depth_mm)
    if values["substrate_per_mm3"]:
        force_N = force_N * (1 + values["substrate_per_mm3"] * depth_mm**3)
    if values["fung_per_mm"]:
        force_N = force_N * fung_form(depth_mm, values["fung_per_mm"])
    if values["ogden_per_mm"]:
        force_N = force_N * ogden_form(depth_mm, values["ogden_per_mm"], values["ogden_exponent"])
    if values["layer_ratio"]:
        force_N = force_N * layer_form(depth_mm, values["layer_ratio"])
    if "bend" in values:
        force_N = force_N * (1 + np.interp(depth_mm, values["bend_mm"], values["bend"]))
    return force_N


def fung_form(depth_mm: FloatArray, rate_per_mm: float | FloatArray) -> FloatArray:
    """(exp(b x) - 1) / (b x): Fung's force over that of its slope at contact (Fung 1967), same shape."""
    grown = np.clip(rate_per_mm * depth_mm, SMALLEST_MM, LARGEST_EXPONENT)
    return np.asarray(np.expm1(grown) / grown)


def ogden_form(depth_mm: FloatArray, per_mm: float | FloatArray, exponent: float | FloatArray) -> FloatArray:
    """The same of an incompressible block of one Ogden term, ``per_mm`` one over its thickness (Ogden 1972)."""
    strain = np.clip(per_mm * depth_mm, SMALLEST_MM, LARGEST_STRAIN)
    stress = (1 - strain) ** (-exponent / 2 - 1) - (1 - strain) ** (exponent - 1)
    return np.asarray(2 / (3 * exponent) * stress / strain)


def layer_form(depth_mm: FloatArray, ratio: float | FloatArray) -> FloatArray:
    """The same of a sphere on a bonded incompressible layer, Hertz at 5 mm being 1 (Dimitriadis 2002, eq. 12).

    ``ratio`` is the contact radius sqrt(R x) over the layer's thickness at 5 mm.
    """
    root = np.sqrt(depth_mm / REFERENCE_MM)
    chi = ratio * root
    return np.asarray(root * (1 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4))
