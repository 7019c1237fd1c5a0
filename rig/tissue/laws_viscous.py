"""Laws whose force depends on how the tip came to its depth: damping that grows with depth, and relaxation.

Laws with ``terms`` are quasi-linear (Fung 1993, ch. 7): elastic force times a relaxation 1 + sum r_i exp(-t/tau_i).
Where a quick way back leaves the surface behind, their force comes out negative: contact is lost there.
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from rig.tissue.history import Term
from rig.tissue.laws import FloatArray, Linear, ParameterBounds, straight
from rig.tissue.laws_elastic import FungShape, PowerShape

AtRest: TypeAlias = Annotated[float, ParameterBounds("N/mm", 1e-6, 1e4, "stiffness at rest")]
Branch: TypeAlias = Annotated[float, ParameterBounds("N/mm", 0.0, 1e4, "stiffness that relaxes")]
Tau: TypeAlias = Annotated[float, ParameterBounds("s", 1e-3, 1e3, "time of relaxation")]


@dataclass(frozen=True, kw_only=True)
class HuntCrossley(PowerShape):
    """F = a x^n + lambda x^n v: damping grows with depth, so nothing jumps at contact and nothing pulls at its end.

    Hunt and Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", J. Appl. Mech. 42 (1975) 440.
    """

    name: ClassVar[str] = "hunt_crossley"
    formula: ClassVar[str] = "F = a x^n + lambda x^n v"

    lambda_N_s_mmn1: Annotated[float, ParameterBounds("N s/mm^(n+1)", 0.0, 1e3, "damping at 1 mm")]

    def damping(self, depth_mm: FloatArray) -> FloatArray:
        """lambda x^n."""
        return np.asarray(self.lambda_N_s_mmn1 * depth_mm**self.exponent)

    def damping_slope(self, depth_mm: FloatArray) -> FloatArray:
        """n lambda x^(n-1)."""
        return np.asarray(self.exponent * self.lambda_N_s_mmn1 * depth_mm ** (self.exponent - 1.0))

    def depth(self, force_N: ArrayLike, rate_mm_s: ArrayLike = 0.0) -> FloatArray:
        """(F / (a + lambda v))^(1/n); 0 where the tip leaves so fast that nothing presses on it."""
        force, rate = np.broadcast_arrays(np.asarray(force_N, float), np.asarray(rate_mm_s, float))
        factor = self.a_N_mmn + self.lambda_N_s_mmn1 * rate
        reached = np.maximum(force, 0.0) / np.where(factor > 0, factor, np.inf)
        return np.asarray(reached ** (1.0 / self.exponent))


@dataclass(frozen=True, kw_only=True)
class StandardLinear(Linear):
    """Standard linear solid: a spring k beside a spring k1 in series with a damper k1 tau (Zener 1948).

    After a sudden depth x: F = (k + k1 exp(-t/tau)) x. At speed v: F = k x + k1 v tau (1 - exp(-x/(v tau))).
    """

    name: ClassVar[str] = "sls"
    formula: ClassVar[str] = "F = k x + int k1 exp(-(t-s)/tau) dx(s)"

    k_N_mm: AtRest
    k1_N_mm: Branch
    tau_s: Tau

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """The line through contact, a third of it relaxing."""
        k = straight(depth_mm, force_N)
        return {"k_N_mm": 0.75 * k, "k1_N_mm": 0.25 * k, "tau_s": 0.3}

    @property
    def stiffness_N_mm(self) -> float:
        """k."""
        return self.k_N_mm

    @property
    def terms(self) -> tuple[Term, ...]:
        """k1/k over tau."""
        return (Term(self.k1_N_mm / self.k_N_mm, self.tau_s),)


@dataclass(frozen=True, kw_only=True)
class Prony(Linear):
    """A Prony series of two terms, the generalised Maxwell solid: F(t) = int [k + sum k_i exp(-(t-s)/tau_i)] dx(s).

    Residual limbs: Tonuk and Silver-Thorn fitted two terms, and found that they do not carry over between sites.
    """

    name: ClassVar[str] = "prony"
    formula: ClassVar[str] = "F = k x + int (k1 exp(-(t-s)/tau1) + k2 exp(-(t-s)/tau2)) dx(s)"

    k_N_mm: AtRest
    k1_N_mm: Branch
    tau1_s: Tau
    k2_N_mm: Branch
    tau2_s: Tau

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """The line through contact, a third of it relaxing, half soon and half late."""
        k = straight(depth_mm, force_N)
        return {"k_N_mm": 0.75 * k, "k1_N_mm": 0.125 * k, "tau1_s": 0.1, "k2_N_mm": 0.125 * k, "tau2_s": 1.0}

    @property
    def stiffness_N_mm(self) -> float:
        """k."""
        return self.k_N_mm

    @property
    def terms(self) -> tuple[Term, ...]:
        """k_i/k over tau_i."""
        return (Term(self.k1_N_mm / self.k_N_mm, self.tau1_s), Term(self.k2_N_mm / self.k_N_mm, self.tau2_s))


@dataclass(frozen=True, kw_only=True)
class QuasiLinear(FungShape):
    """Fung's quasi-linear law with one term: elastic force A (exp(b x) - 1), relaxation 1 + r exp(-t/tau).

    Zheng and Mak (1999, J. Biomech. Eng. 121, 330) use one term for limbs; their alpha is r/(1 + r): 0.03 to 0.28.
    """

    name: ClassVar[str] = "qlv"
    formula: ClassVar[str] = "F = int (1 + r exp(-(t-s)/tau)) d[A (exp(b x(s)) - 1)]"

    relaxation_ratio: Annotated[float, ParameterBounds("1", 0.0, 100.0, "force that relaxes over force at rest")]
    tau_s: Tau

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """The elastic law near the data, a fifth of its force relaxing."""
        elastic = super().near(depth_mm, force_N)
        return {**elastic, "A_N": elastic["A_N"] / 1.25, "relaxation_ratio": 0.25, "tau_s": 0.3}

    @property
    def terms(self) -> tuple[Term, ...]:
        """r over tau."""
        return (Term(self.relaxation_ratio, self.tau_s),)
