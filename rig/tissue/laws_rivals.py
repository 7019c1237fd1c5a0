"""Two-parameter rivals of the index model, so that "exponential" is a finding and not the only thing tried."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rig.tissue.laws import DAMPING, Bounds, FloatArray, Law


@dataclass(frozen=True, kw_only=True)
class Quadratic(Law):
    """F = a x + c x^2 + B v: limbs' load-indentation curves (Zheng, Mak, Lue 1999), and any deep indentation (F = beta
    E D^2).
    """

    name: ClassVar[str] = "quadratic"
    formula: ClassVar[str] = "F = a x + c x^2 + B v"
    bounds: ClassVar[Mapping[str, Bounds]] = {
        "a_N_mm": Bounds("N/mm", 1e-6, 1e4, "stiffness at contact"),
        "c_N_mm2": Bounds("N/mm^2", 0.0, 1e3, "stiffening per depth"),
        "B_N_s_mm": DAMPING,
    }

    a_N_mm: float
    c_N_mm2: float

    @classmethod
    def guess(cls, depth_mm: FloatArray, force_N: FloatArray) -> "Quadratic":
        """Linear least squares, kept inside the bounds."""
        (a, c), *_ = np.linalg.lstsq(np.column_stack([depth_mm, depth_mm**2]), force_N, rcond=None)
        return cls(a_N_mm=float(np.clip(a, 1e-6, 1e4)), c_N_mm2=float(np.clip(c, 0.0, 1e3)), B_N_s_mm=0.0)

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
class Power(Law):
    """F = a x^n + B v; n = 1.5 is Hertz's sphere, n = 2 the cone and any tip pushed in deep."""

    name: ClassVar[str] = "power"
    formula: ClassVar[str] = "F = a x^n + B v"
    bounds: ClassVar[Mapping[str, Bounds]] = {
        "a_N_mmn": Bounds("N/mm^n", 1e-6, 1e4, "force at 1 mm"),
        "n": Bounds("1", 1.0, 6.0, "exponent"),
        "B_N_s_mm": DAMPING,
    }

    a_N_mmn: float
    n: float

    @classmethod
    def guess(cls, depth_mm: FloatArray, force_N: FloatArray) -> "Power":
        """The straight line ln F = ln a + n ln x, weighted with force."""
        n, level = np.polyfit(np.log(depth_mm), np.log(force_N), 1, w=force_N)
        return cls(a_N_mmn=float(np.clip(np.exp(level), 1e-6, 1e4)), n=float(np.clip(n, 1.0, 6.0)), B_N_s_mm=0.0)

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """a x^n."""
        return np.asarray(self.a_N_mmn * depth_mm**self.n)

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """n a x^(n-1)."""
        return np.asarray(self.n * self.a_N_mmn * depth_mm ** (self.n - 1.0))

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """(F/a)^(1/n)."""
        return np.asarray((force_N / self.a_N_mmn) ** (1.0 / self.n))


@dataclass(frozen=True, kw_only=True)
class Fung(Law):
    """F = A (exp(b x) - 1) + B v, the elastic part of Fung's quasi-linear viscoelasticity (Fung 1993, ch. 7)."""

    name: ClassVar[str] = "fung"
    formula: ClassVar[str] = "F = A (exp(b x) - 1) + B v"
    bounds: ClassVar[Mapping[str, Bounds]] = {
        "A_N": Bounds("N", 1e-6, 1e5, "force scale"),
        "b_per_mm": Bounds("1/mm", 1e-4, 5.0, "stiffening per depth"),
        "B_N_s_mm": DAMPING,
    }

    A_N: float
    b_per_mm: float

    @classmethod
    def guess(cls, depth_mm: FloatArray, force_N: FloatArray) -> "Fung":
        """b from the forces at the largest depth and at half of it: F(2x)/F(x) = exp(b x) + 1."""
        order = np.argsort(depth_mm)
        deep, top = float(depth_mm[order[-1]]), float(force_N[order[-1]])
        half = float(np.interp(0.5 * deep, depth_mm[order], force_N[order]))
        b = float(np.clip(np.log(max(top / max(half, 1e-9) - 1.0, 1.01)) / (0.5 * deep), 1e-3, 3.0))
        return cls(A_N=float(np.clip(top / np.expm1(b * deep), 1e-6, 1e5)), b_per_mm=b, B_N_s_mm=0.0)

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """A (exp(b x) - 1)."""
        return self.A_N * np.expm1(self.b_per_mm * depth_mm)

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """A b exp(b x)."""
        return self.A_N * self.b_per_mm * np.exp(self.b_per_mm * depth_mm)

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """ln(1 + F/A) / b."""
        return np.log1p(force_N / self.A_N) / self.b_per_mm


RIVALS: tuple[type[Law], ...] = (Quadratic, Power, Fung)
