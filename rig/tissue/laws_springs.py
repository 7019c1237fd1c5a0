"""The lattice whose springs stiffen each by itself, as a law to fit and judge like any other."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from scipy.interpolate import RectBivariateSpline

from rig.tissue.lattice.newton import tangent_stiffness_N_mm
from rig.tissue.lattice.ramp import DepthRamp, project
from rig.tissue.lattice.state import Loaded
from rig.tissue.laws import Damped, FloatArray, Law, ParameterBounds, bisect
from rig.tissue.laws_lattice import FURTHER, SpringStiffness

GUESSES = 100


class PhiSurface:
    """phi(d; b) and its slope: a bicubic spline of ln(phi/d), at d = 0 the tangent at rest, where b plays no part; past
    the last depth straight on.
    """

    def __init__(self, ramp: DepthRamp) -> None:
        rest_mm = tangent_stiffness_N_mm(Loaded(ramp.block, ramp.springs)) / ramp.springs.k_N_mm
        inside = np.log(ramp.phi_mm / ramp.depth_mm).T
        nodes = np.vstack([np.full_like(ramp.exponents, np.log(rest_mm)), inside])
        self._spline = RectBivariateSpline(np.append(0.0, ramp.depth_mm), ramp.exponents, nodes)
        self.end_mm, self.largest_b = float(ramp.depth_mm[-1]), float(ramp.exponents[-1])

    def _ln(self, depth_mm: FloatArray, b: float, derivative: int = 0) -> FloatArray:
        return np.asarray(self._spline.ev(depth_mm, np.full_like(depth_mm, b), dx=derivative))

    def __call__(self, depth_mm: FloatArray, b: float) -> FloatArray:
        """phi in mm, same shape."""
        inside_mm = np.minimum(depth_mm, self.end_mm)
        phi_mm = inside_mm * np.exp(self._ln(inside_mm, b))
        return np.asarray(phi_mm + (depth_mm - inside_mm) * self.rise(inside_mm, b))

    def rise(self, depth_mm: FloatArray, b: float) -> FloatArray:
        """dphi/dd, same shape."""
        inside_mm = np.minimum(depth_mm, self.end_mm)
        bend = self._ln(inside_mm, b, 1)
        return np.asarray(np.exp(self._ln(inside_mm, b)) * (1.0 + inside_mm * bend))


@dataclass(frozen=True, kw_only=True)
class LatticeSprings(Damped):
    """The lattice with k = a exp(b |e|) in each spring, e its own strain."""

    name: ClassVar[str] = "lattice springs"
    formula: ClassVar[str] = "F = a phi(x; b) + B v, spring by spring a exp(b |strain|)"
    surface: ClassVar[PhiSurface]

    a_N_mm: SpringStiffness
    b: Annotated[float, ParameterBounds("1", 0.0, 40.0, "stiffening per strain of a spring")]

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """Variable projection on a grid of b."""
        grid = np.linspace(0.0, cls.surface.largest_b, GUESSES)
        tried = [project(force_N, cls.surface(depth_mm, b)) for b in grid]
        best = int(np.argmin([misfit for _, misfit in tried]))
        return {"a_N_mm": tried[best][0], "b": float(grid[best])}

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """a phi(x; b)."""
        return self.a_N_mm * self.surface(depth_mm, self.b)

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """a phi'(x; b)."""
        return self.a_N_mm * self.surface.rise(depth_mm, self.b)

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """By bisection to half as far again as the ramp went."""
        deepest_mm = np.full_like(force_N, FURTHER * self.surface.end_mm)
        return bisect(self.elastic, force_N, np.zeros_like(force_N), deepest_mm)


def springs_law(ramp: DepthRamp) -> type[Law]:
    """The law with the ramp's phi; b is bounded by the ramp's largest."""
    surface = PhiSurface(ramp)
    bounds = {**LatticeSprings.bounds, "b": LatticeSprings.bounds["b"]._replace(upper=surface.largest_b)}
    return type("LatticeSprings", (LatticeSprings,), {"surface": surface, "bounds": bounds})
