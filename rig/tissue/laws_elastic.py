"""Elastic laws besides the study's two: alternatives with as many parameters, and a thin layer on bone."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from rig.tissue.hayes import punch_stiffness_N_mm
from rig.tissue.laws import Damped, FloatArray, Law, Linear, ParameterBounds, straight


@dataclass(frozen=True, kw_only=True)
class Quadratic(Damped):
    """F = a x + c x^2 + B v: limbs' load-indentation curves (Zheng, Mak, Lue 1999), and any deep indentation (F = beta
    E D^2).
    """

    name: ClassVar[str] = "quadratic"
    formula: ClassVar[str] = "F = a x + c x^2 + B v"

    a_N_mm: Annotated[float, ParameterBounds("N/mm", 1e-6, 1e4, "stiffness at contact")]
    c_N_mm2: Annotated[float, ParameterBounds("N/mm^2", 0.0, 1e3, "stiffening per depth")]

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """Linear least squares."""
        (a, c), *_ = np.linalg.lstsq(np.column_stack([depth_mm, depth_mm**2]), force_N, rcond=None)
        return {"a_N_mm": float(a), "c_N_mm2": float(c)}

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """a x + c x^2."""
        return self.a_N_mm * depth_mm + self.c_N_mm2 * depth_mm**2

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """a + 2 c x."""
        return self.a_N_mm + 2.0 * self.c_N_mm2 * depth_mm

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """The root written so that c = 0 is no special case: 2 F / (a + sqrt(a^2 + 4 c F))."""
        return 2.0 * force_N / (self.a_N_mm + np.sqrt(self.a_N_mm**2 + 4.0 * self.c_N_mm2 * force_N))


@dataclass(frozen=True, kw_only=True)
class PowerShape(Law):
    """Force at rest a x^n; n = 1.5 is Hertz's sphere, n = 2 the cone and any tip pushed in deep."""

    a_N_mmn: Annotated[float, ParameterBounds("N/mm^n", 1e-6, 1e4, "force at 1 mm")]
    exponent: Annotated[float, ParameterBounds("1", 1.0, 6.0, "exponent")]

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """a and n of the straight line ln F = ln a + n ln x, weighted with force."""
        n, level = np.polyfit(np.log(depth_mm), np.log(force_N), 1, w=force_N)
        return {"a_N_mmn": float(np.exp(level)), "exponent": float(n)}

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """a x^n."""
        return np.asarray(self.a_N_mmn * depth_mm**self.exponent)

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """n a x^(n-1)."""
        return np.asarray(self.exponent * self.a_N_mmn * depth_mm ** (self.exponent - 1.0))

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """(F/a)^(1/n)."""
        return np.asarray((force_N / self.a_N_mmn) ** (1.0 / self.exponent))


@dataclass(frozen=True, kw_only=True)
class Power(PowerShape, Damped):
    """F = a x^n + B v."""

    name: ClassVar[str] = "power"
    formula: ClassVar[str] = "F = a x^n + B v"


@dataclass(frozen=True, kw_only=True)
class FungShape(Law):
    """Force at rest A (exp(b x) - 1), the elastic part of Fung's quasi-linear viscoelasticity (Fung 1993, ch. 7)."""

    A_N: Annotated[float, ParameterBounds("N", 1e-6, 1e5, "force scale")]
    b_per_mm: Annotated[float, ParameterBounds("1/mm", 1e-4, 5.0, "stiffening per depth")]

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """A and b from the forces at the largest depth and at half of it: F(2x)/F(x) = exp(b x) + 1."""
        order = np.argsort(depth_mm)
        deep, top = float(depth_mm[order[-1]]), float(force_N[order[-1]])
        half = float(np.interp(0.5 * deep, depth_mm[order], force_N[order]))
        b = float(np.clip(np.log(max(top / max(half, 1e-9) - 1.0, 1.01)) / (0.5 * deep), 1e-3, 3.0))
        return {"A_N": top / float(np.expm1(b * deep)), "b_per_mm": b}

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """A (exp(b x) - 1)."""
        return self.A_N * np.expm1(self.b_per_mm * depth_mm)

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """A b exp(b x)."""
        return self.A_N * self.b_per_mm * np.exp(self.b_per_mm * depth_mm)

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """ln(1 + F/A) / b."""
        return np.log1p(force_N / self.A_N) / self.b_per_mm


@dataclass(frozen=True, kw_only=True)
class Fung(FungShape, Damped):
    """F = A (exp(b x) - 1) + B v."""

    name: ClassVar[str] = "fung"
    formula: ClassVar[str] = "F = A (exp(b x) - 1) + B v"


@dataclass(frozen=True, kw_only=True)
class Layer(Linear, Damped):
    """A flat punch of radius r on an elastic layer of thickness h bonded to bone, after Hayes et al. (1972).

    F = 2 r E kappa(r/h, nu) x / (1 - nu^2) + B v; kappa is solved from their integral equation (`hayes`). Small strain
    only. One curve gives the product, so radius, thickness and Poisson's ratio nu are known, and E is fitted.
    """

    name: ClassVar[str] = "layer"
    formula: ClassVar[str] = "F = 2 r E kappa(r/h, nu) x / (1 - nu^2) + B v"
    known: ClassVar[Mapping[str, float]] = {"radius_mm": 3.0, "thickness_mm": 39.0, "poisson_ratio": 0.45}

    E_MPa: Annotated[float, ParameterBounds("MPa", 1e-6, 1e4, "Young's modulus")]
    radius_mm: Annotated[float, ParameterBounds("mm", 0.1, 100.0, "radius of the tip")]
    thickness_mm: Annotated[float, ParameterBounds("mm", 0.1, 1e4, "tissue above the bone")]
    poisson_ratio: Annotated[float, ParameterBounds("1", 0.0, 0.5, "Poisson's ratio")]

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.stiffness_N_mm  # refuses a tip too wide for the layer

    @property
    def stiffness_N_mm(self) -> float:
        """2 r E kappa / (1 - nu^2)."""
        return punch_stiffness_N_mm(self.E_MPa, self.poisson_ratio, self.radius_mm, self.thickness_mm)

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """E from the line through contact, for the tip and layer known."""
        soft = cls(E_MPa=1.0, damping_N_s_mm=0.0, **cls.known)
        return {"E_MPa": straight(depth_mm, force_N) / soft.stiffness_N_mm, **cls.known}
