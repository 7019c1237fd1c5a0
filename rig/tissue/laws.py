"""What tissue answers to a tip that is pushed into it: small classes with one interface, chosen by name.

Depth is the tip's displacement from contact, positive into the tissue; force is positive in compression. Nothing pulls:
outside the tissue (depth below zero) force and stiffness are zero.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import lambertw

from rig.errors import UsageError

FloatArray = NDArray[np.float64]
SMALLEST = np.finfo(float).tiny


class Bounds(NamedTuple):
    """Unit of a parameter, what it may be, and what it means."""

    unit: str
    lower: float
    upper: float
    meaning: str


class Parameter(NamedTuple):
    """One parameter of a law with its value."""

    name: str
    value: float
    unit: str
    lower: float
    upper: float


DAMPING = Bounds("N s/mm", 0.0, 10.0, "damping: force per speed of the tip")


@dataclass(frozen=True, kw_only=True)
class Law(ABC):
    """An elastic law and a damping term: F(x, v) = elastic(x) + B v for x >= 0, and 0 for x < 0.

    Subclasses are frozen dataclasses whose fields are the parameters; they give the elastic part for x >= 0, its
    derivative and its inverse. A parameter outside its bounds raises UsageError.
    """

    name: ClassVar[str]
    formula: ClassVar[str]
    bounds: ClassVar[Mapping[str, Bounds]]

    B_N_s_mm: float

    def __post_init__(self) -> None:
        for parameter in self.parameters:
            if not parameter.lower <= parameter.value <= parameter.upper:
                raise UsageError(
                    f"{self.name} law: {parameter.name} = {parameter.value:g} {parameter.unit} is outside "
                    f"{parameter.lower:g} to {parameter.upper:g} {parameter.unit}; correct the parameter"
                )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Name, value, unit and bounds of each parameter, in a fixed order."""
        values = asdict(self)
        return tuple(Parameter(name, values[name], b.unit, b.lower, b.upper) for name, b in self.bounds.items())

    @property
    def values(self) -> FloatArray:
        """The parameters' values, shape (p,), in the order of ``parameters``."""
        return np.array([parameter.value for parameter in self.parameters])

    @classmethod
    def from_values(cls, values: Sequence[float] | FloatArray) -> Self:
        """The law with these parameters, in the order of ``bounds``."""
        return cls(**dict(zip(cls.bounds, map(float, values), strict=True)))

    @classmethod
    @abstractmethod
    def guess(cls, depth_mm: FloatArray, force_N: FloatArray) -> Self:
        """A law near the data, shape (n,), to start a fit from; depths and forces are above zero."""

    @abstractmethod
    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """Force [N] at rest for depths >= 0, same shape."""

    @abstractmethod
    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """Derivative of ``elastic`` [N/mm] for depths >= 0, same shape."""

    @abstractmethod
    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """Depth [mm] at which ``elastic`` is the force, for forces >= 0, same shape."""

    def force(self, depth_mm: ArrayLike, rate_mm_s: ArrayLike = 0.0) -> FloatArray:
        """Force [N] at depth [mm] and tip speed [mm/s], broadcast; zero outside the tissue."""
        depth, rate = np.broadcast_arrays(np.asarray(depth_mm, float), np.asarray(rate_mm_s, float))
        inside = self.elastic(np.maximum(depth, 0.0)) + self.B_N_s_mm * rate
        return np.where(depth < 0, 0.0, inside)

    def tangent_stiffness(self, depth_mm: ArrayLike) -> FloatArray:
        """dF/dx [N/mm] at constant speed, which is the plant's gain in a force loop; zero outside the tissue."""
        depth = np.asarray(depth_mm, float)
        return np.where(depth < 0, 0.0, self.slope(np.maximum(depth, 0.0)))

    def secant_stiffness(self, depth_mm: ArrayLike) -> FloatArray:
        """elastic(x)/x [N/mm], the study's k(x); its limit at contact is the tangent there; zero outside the tissue."""
        depth = np.asarray(depth_mm, float)
        inside = np.maximum(depth, SMALLEST)
        secant = np.where(depth > SMALLEST, self.elastic(inside) / inside, self.slope(np.zeros_like(depth)))
        return np.where(depth < 0, 0.0, secant)

    def depth(self, force_N: ArrayLike, rate_mm_s: ArrayLike = 0.0) -> FloatArray:
        """Depth [mm] at which the force is reached at that speed, broadcast; 0 where contact alone gives more."""
        force, rate = np.broadcast_arrays(np.asarray(force_N, float), np.asarray(rate_mm_s, float))
        return self.elastic_inverse(np.maximum(force - self.B_N_s_mm * rate, 0.0))


@dataclass(frozen=True, kw_only=True)
class Constant(Law):
    """Kelvin-Voigt with one stiffness: F = k x + B v (equation 6 of the study)."""

    name: ClassVar[str] = "constant"
    formula: ClassVar[str] = "F = k x + B v"
    bounds: ClassVar[Mapping[str, Bounds]] = {
        "k_N_mm": Bounds("N/mm", 1e-6, 1e4, "stiffness"),
        "B_N_s_mm": DAMPING,
    }

    k_N_mm: float

    @classmethod
    def guess(cls, depth_mm: FloatArray, force_N: FloatArray) -> Self:
        """The line through contact and the data's centre of least squares, without damping."""
        return cls(k_N_mm=float(depth_mm @ force_N / (depth_mm @ depth_mm)), B_N_s_mm=0.0)

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """k x."""
        return self.k_N_mm * depth_mm

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """k."""
        return np.full_like(depth_mm, self.k_N_mm)

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """F/k."""
        return force_N / self.k_N_mm


@dataclass(frozen=True, kw_only=True)
class Index(Law):
    """The study's index model: secant stiffness k(x) = a exp(b x) (equation 5), hence F = a x exp(b x) + B v.

    The tangent is a (1 + b x) exp(b x): a loop that takes the secant for it reads the plant's gain low by 1 + b x.
    The inverse is x = W(b F / a) / b with Lambert's W (Corless et al. 1996, "On the Lambert W function").
    """

    name: ClassVar[str] = "index"
    formula: ClassVar[str] = "F = a x exp(b x) + B v"
    bounds: ClassVar[Mapping[str, Bounds]] = {
        "a_N_mm": Bounds("N/mm", 1e-6, 1e4, "secant stiffness at contact"),
        "b_per_mm": Bounds("1/mm", 0.0, 5.0, "stiffening per depth"),
        "B_N_s_mm": DAMPING,
    }

    a_N_mm: float
    b_per_mm: float

    @classmethod
    def guess(cls, depth_mm: FloatArray, force_N: FloatArray) -> Self:
        """The straight line ln(F/x) = ln a + b x, weighted with force, without damping."""
        slope, level = np.polyfit(depth_mm, np.log(force_N / depth_mm), 1, w=force_N)
        bound = cls.bounds["b_per_mm"]
        return cls(a_N_mm=float(np.exp(level)), b_per_mm=float(np.clip(slope, bound.lower, bound.upper)), B_N_s_mm=0.0)

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """a x exp(b x)."""
        return self.a_N_mm * depth_mm * np.exp(self.b_per_mm * depth_mm)

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """a (1 + b x) exp(b x)."""
        growth = self.b_per_mm * depth_mm
        return self.a_N_mm * (1 + growth) * np.exp(growth)

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """W(b F / a) / b; without stiffening F / a."""
        linear = force_N / self.a_N_mm
        argument = self.b_per_mm * linear
        if np.all(argument < 1e-9):
            return linear * (1 - argument)
        with np.errstate(invalid="ignore", divide="ignore"):
            # scipy's stubs leave out arrays whose number of axes is unknown.
            curved = np.real(lambertw(argument)) / self.b_per_mm  # type: ignore[call-overload]
        return np.where(argument < 1e-9, linear * (1 - argument), curved)


LAWS: dict[str, type[Law]] = {law.name: law for law in (Constant, Index)}


def law_named(name: str) -> type[Law]:
    """The law's class; raises UsageError naming the laws there are."""
    if name not in LAWS:
        raise UsageError(f"no tissue law is called {name!r}; choose one of {', '.join(sorted(LAWS))}")
    return LAWS[name]
