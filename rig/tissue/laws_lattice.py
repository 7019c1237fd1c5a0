"""The lattice as laws to fit and judge like any other: with one stiffness, and with the study's global k(x)."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar, TypeAlias

import numpy as np
from scipy.interpolate import PchipInterpolator

from rig.errors import UsageError
from rig.tissue.index_law import index_stiffness
from rig.tissue.lattice.sweep import Sweep
from rig.tissue.laws import Damped, FloatArray, Law, ParameterBounds, depth_rising, straight

LEAST_DEPTHS = 4  # as many as a and b with an interval take
SpringStiffness: TypeAlias = Annotated[float, ParameterBounds("N/mm", 1e-8, 1e3, "spring stiffness at contact")]
FURTHER = 1.5


class Phi:
    """phi(d) = R/k of a sweep and its slope; past the sweep's end straight on, which covers a fit's small offsets."""

    def __init__(self, sweep: Sweep) -> None:
        """Raises UsageError where too few depths of the sweep are intact."""
        depth_mm, phi_mm = sweep.depth_mm[sweep.intact], sweep.force_over_k_mm[sweep.intact]
        if len(depth_mm) < LEAST_DEPTHS:
            raise UsageError(
                f"the sweep has {len(depth_mm)} intact depths ({sweep.collapse()}); {LEAST_DEPTHS} are needed: use "
                "smaller steps"
            )
        self._curve: PchipInterpolator = sweep.interpolant()
        self._slope = self._curve.derivative()
        self.end_mm, self._top_mm = float(depth_mm[-1]), float(phi_mm[-1])
        self._last = float(self._slope(self.end_mm))

    def __call__(self, depth_mm: FloatArray) -> FloatArray:
        """phi in mm, same shape."""
        inside_mm = self._curve(np.minimum(depth_mm, self.end_mm))
        return np.where(depth_mm <= self.end_mm, inside_mm, self._top_mm + self._last * (depth_mm - self.end_mm))

    def rise(self, depth_mm: FloatArray) -> FloatArray:
        """dphi/dd, same shape."""
        return np.where(depth_mm <= self.end_mm, self._slope(np.minimum(depth_mm, self.end_mm)), self._last)


@dataclass(frozen=True, kw_only=True)
class LatticeLaw(Damped):
    """F = k(x) phi(x) + B v."""

    phi: ClassVar[Phi]

    @abstractmethod
    def spring_N_mm(self, depth_mm: FloatArray) -> FloatArray:
        """k(x), same shape."""

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """k(x) phi(x)."""
        return self.spring_N_mm(depth_mm) * self.phi(depth_mm)

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """By bisection to half as far again as the sweep went."""
        return depth_rising(self.elastic, force_N, FURTHER * self.phi.end_mm)


@dataclass(frozen=True, kw_only=True)
class LatticeConstant(LatticeLaw):
    """The lattice with one stiffness."""

    name: ClassVar[str] = "lattice constant"
    formula: ClassVar[str] = "F = k phi(x) + B v"

    k_N_mm: SpringStiffness

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """Linear least squares."""
        return {"k_N_mm": straight(cls.phi(depth_mm), force_N)}

    def spring_N_mm(self, depth_mm: FloatArray) -> FloatArray:
        """k."""
        return np.full_like(depth_mm, self.k_N_mm)

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """k phi'."""
        return self.k_N_mm * self.phi.rise(depth_mm)


@dataclass(frozen=True, kw_only=True)
class LatticeIndex(LatticeLaw):
    """The lattice with the study's k(x) = a exp(b x), x the depth of the tip."""

    name: ClassVar[str] = "lattice index"
    formula: ClassVar[str] = "F = a exp(b x) phi(x) + B v"

    a_N_mm: SpringStiffness
    b_per_mm: Annotated[float, ParameterBounds("1/mm", -2.0, 5.0, "stiffening per depth")]

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """The straight line ln(F/phi) = ln a + b x, weighted with force."""
        b, level = np.polyfit(depth_mm, np.log(force_N / cls.phi(depth_mm)), 1, w=force_N)
        return {"a_N_mm": float(np.exp(level)), "b_per_mm": float(b)}

    def spring_N_mm(self, depth_mm: FloatArray) -> FloatArray:
        """a exp(b x)."""
        return index_stiffness(depth_mm, self.a_N_mm, self.b_per_mm)

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """a exp(b x) (phi' + b phi): the tangent the loop sees."""
        return self.spring_N_mm(depth_mm) * (self.phi.rise(depth_mm) + self.b_per_mm * self.phi(depth_mm))


def lattice_laws(sweep: Sweep) -> tuple[type[Law], type[Law]]:
    """Both laws with the sweep's phi."""
    shape = {"phi": Phi(sweep)}
    return type("LatticeConstant", (LatticeConstant,), shape), type("LatticeIndex", (LatticeIndex,), shape)
