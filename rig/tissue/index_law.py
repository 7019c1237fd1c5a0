"""The index law and its extensions as functions of arrays: laws, simulation and diagnosis all call these.

A parameter is one number, or an array that goes with the depths where it differs between recordings.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Fields = Mapping[str, float | FloatArray]
REFERENCE_MM = 5.0
# exp(30) is 1e13: a search that tries such a growth is told so by a number that can still be squared and summed.
LARGEST_EXPONENT = 30.0
# A power below one has an infinite slope at contact; a nanometre is far below what any encoder resolves.
SMALLEST_MM = 1e-6


def index_stiffness(depth_mm: FloatArray, a_N_mm: float | FloatArray, b_per_mm: float | FloatArray) -> FloatArray:
    """The study's secant stiffness k(x) = a exp(b x) [N/mm], same shape."""
    return np.asarray(a_N_mm * np.exp(np.minimum(b_per_mm * depth_mm, LARGEST_EXPONENT)))


def index_force(depth_mm: FloatArray, a_N_mm: float | FloatArray, b_per_mm: float | FloatArray) -> FloatArray:
    """a x exp(b x) [N] for depths >= 0, same shape."""
    return index_stiffness(depth_mm, a_N_mm * depth_mm, b_per_mm)


def extended_force(depth_mm: FloatArray, values: Fields) -> FloatArray:
    """The index law times (x / 5 mm)^(n-1), 1 + q x and 1 + s x^3 where these are off their null [N], depths >= 0."""
    force_N = index_force(depth_mm, values["a_N_mm"], values["b_per_mm"])
    if values["exponent"] != 1:
        force_N = force_N * (np.maximum(depth_mm, SMALLEST_MM) / REFERENCE_MM) ** (values["exponent"] - 1)
    if values["quadratic_per_mm"]:
        force_N = force_N * (1 + values["quadratic_per_mm"] * depth_mm)
    if values["substrate_per_mm3"]:
        force_N = force_N * (1 + values["substrate_per_mm3"] * depth_mm**3)
    return force_N
