"""What tissue answers to a tip that is pushed into it: small classes with one interface.

Depth is the tip's displacement from contact, positive into the tissue; force is positive in compression. Nothing pulls:
outside the tissue (depth below zero) force and stiffness are zero. `registry` finds every law by name.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from inspect import get_annotations
from typing import Annotated, ClassVar, NamedTuple, Self, TypeAlias, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import lambertw

from rig.errors import UsageError
from rig.tissue.history import SMALLEST, History, Term, ramped
from rig.tissue.index_law import index_force

FloatArray = NDArray[np.float64]
PLACES = 2001  # of a limb of 200 mm every 0.1 mm
BISECTIONS = 60


class ParameterBounds(NamedTuple):
    """Unit of a parameter, what it may be, and what it means."""

    unit: str
    lower: float
    upper: float
    meaning: str


SecantAtContact: TypeAlias = Annotated[float, ParameterBounds("N/mm", 1e-6, 1e4, "secant stiffness at contact")]


class Parameter(NamedTuple):
    """One parameter of a law with its value."""

    name: str
    value: float
    unit: str
    lower: float
    upper: float


@dataclass(frozen=True, kw_only=True)
class Law(ABC):
    """Force at depth x and speed v: F = int (1 + sum r_i exp(-(t-s)/tau_i)) de(x(s)) + damping(x) v; 0 for x < 0.

    Subclasses are frozen dataclasses whose fields are the parameters, each annotated with its ``ParameterBounds``; they
    give the elastic part e (what is left when the tip rests) for x >= 0, its derivative and its inverse, and damping or
    the ``terms`` of relaxation if there are any. A parameter outside its bounds raises UsageError. ``known`` are
    parameters that a fit takes as given, with the value it takes unless told another; ``later`` those that files of a
    model may lack, as the law has them for a shorter time, and which are off then.
    """

    name: ClassVar[str]
    formula: ClassVar[str]
    bounds: ClassVar[Mapping[str, ParameterBounds]]
    known: ClassVar[Mapping[str, float]] = {}
    later: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls) -> None:
        if get_annotations(cls):
            hints = get_type_hints(cls, include_extras=True).items()
            declared = {name: hint.__metadata__[0] for name, hint in hints if hasattr(hint, "__metadata__")}
            # The order of a model's covariance: damping last, but before what has a null and is off unless named.
            order = sorted(declared, key=lambda name: (hasattr(cls, name), name == "damping_N_s_mm"))
            cls.bounds = {name: declared[name] for name in order}

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
    def clipped(cls, **values: float) -> Self:
        """The law with these parameters, each moved inside its bounds."""
        return cls(**{name: float(np.clip(values[name], b.lower, b.upper)) for name, b in cls.bounds.items()})

    def held(self) -> type[Self]:
        """The same kind of law, whose ``known`` parameters a fit takes as they are here."""
        known = {name: float(getattr(self, name)) for name in self.known}
        return type(type(self).__name__, (type(self),), {"known": known})

    @classmethod
    def guess(cls, depth_mm: FloatArray, force_N: FloatArray) -> Self:
        """A law near the data, shape (n,), to start a fit from; depths and forces are above zero."""
        return cls.clipped(**(dict.fromkeys(cls.bounds, 0.0) | cls.near(depth_mm, force_N)))

    @classmethod
    @abstractmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """Parameters near the data, shape (n,), those left out being zero; depths and forces are above zero."""

    @abstractmethod
    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """Force [N] at rest for depths >= 0, same shape."""

    @abstractmethod
    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """Derivative of ``elastic`` [N/mm] for depths >= 0, same shape."""

    @abstractmethod
    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """Depth [mm] at which ``elastic`` is the force, for forces >= 0, same shape."""

    def damping(self, depth_mm: FloatArray) -> FloatArray:
        """dF/dv [N s/mm] for depths >= 0, same shape; what relaxation gives is not counted. Most have none."""
        return np.zeros_like(depth_mm)

    def depth(self, force_N: ArrayLike, rate_mm_s: ArrayLike = 0.0) -> FloatArray:
        """Depth [mm] at which the force is reached at that speed, broadcast; 0 where contact alone gives more.

        The damping is the same at all depths, but of laws that say otherwise. With relaxation by bisection between the
        depths at which the force is reached suddenly and at rest.
        """
        force, rate = np.broadcast_arrays(np.asarray(force_N, float), np.asarray(rate_mm_s, float))
        held_N = np.maximum(force - self.damping(np.zeros_like(force)) * rate, 0.0)
        at_rest_mm = self.elastic_inverse(held_N)
        if not self.terms:
            return at_rest_mm
        return bisect(
            lambda depth_mm: self.force(depth_mm, rate), force, self.elastic_inverse(held_N / self.sudden), at_rest_mm
        )

    @property
    def terms(self) -> tuple[Term, ...]:
        """Terms of the relaxation; most laws have none."""
        return ()

    @property
    def friction(self) -> tuple[float, float]:
        """Level [N] of linear-guide friction in front of the sensor, and the travel [mm] that builds it up."""
        return 0.0, 1.0

    @property
    def sudden(self) -> float:
        """Elastic force after a sudden move over that at rest: 1 + sum r_i."""
        return 1.0 + sum(term.ratio for term in self.terms)

    def damping_slope(self, depth_mm: FloatArray) -> FloatArray:
        """Derivative of ``damping`` [N s/mm^2] for depths >= 0, same shape."""
        return np.zeros_like(depth_mm)

    def force(self, depth_mm: ArrayLike, rate_mm_s: ArrayLike = 0.0, history: History | None = None) -> FloatArray:
        """Force [N] at depth [mm] and tip speed [mm/s], broadcast; zero outside the tissue.

        ``history`` makes the depths one path through time. Without it the tip has come from contact at the speed given
        (at speed 0, or on the way out: infinitely slowly). Laws without relaxation give the same for both.
        """
        depth, rate = np.broadcast_arrays(np.asarray(depth_mm, float), np.asarray(rate_mm_s, float))
        reached = np.maximum(depth, 0.0)
        elastic = self.elastic(reached)
        if self.terms and history:
            elastic = history.respond(elastic, self.terms)
        elif self.terms:
            elastic = elastic + ramped(self.slope, reached, rate, self.terms)
        return np.where(depth < 0, 0.0, elastic + self.damping(reached) * rate)

    def path_stiffness(self, depth_mm: FloatArray, rate_mm_s: FloatArray, history: History) -> FloatArray:
        """How much each force of a path grows [N/mm] where the whole path lies deeper; arrays of shape (n,)."""
        reached = np.maximum(depth_mm, 0.0)
        slope = np.where(depth_mm < 0, 0.0, self.slope(reached))
        kept = history.respond(slope, self.terms) if self.terms else slope
        return np.where(depth_mm < 0, 0.0, kept + self.damping_slope(reached) * rate_mm_s)

    def tangent_stiffness(self, depth_mm: ArrayLike) -> FloatArray:
        """dF/dx [N/mm] in a quick small move from rest, the plant's gain in a force loop; zero outside the tissue.

        With relaxation that is the instantaneous one, (1 + sum r_i) ``slope``: a loop sees it where its crossover is
        faster than the times of relaxation. ``slope`` is what is left of it at rest.
        """
        depth = np.asarray(depth_mm, float)
        return np.where(depth < 0, 0.0, self.sudden * self.slope(np.maximum(depth, 0.0)))

    def secant_stiffness(self, depth_mm: ArrayLike) -> FloatArray:
        """elastic(x)/x [N/mm], the study's k(x); its limit at contact is the tangent there; zero outside the tissue."""
        depth = np.asarray(depth_mm, float)
        inside = np.maximum(depth, SMALLEST)
        secant = np.where(depth > SMALLEST, self.elastic(inside) / inside, self.slope(np.zeros_like(depth)))
        return np.where(depth < 0, 0.0, secant)


@dataclass(frozen=True, kw_only=True)
class Damped(Law):
    """An elastic law and one damping for all depths: F = elastic(x) + B v."""

    damping_N_s_mm: Annotated[float, ParameterBounds("N s/mm", 0.0, 10.0, "damping: force per speed of the tip")]

    def damping(self, depth_mm: FloatArray) -> FloatArray:
        """B."""
        return np.full_like(depth_mm, self.damping_N_s_mm)


class Linear(Law):
    """A law whose force at rest is a stiffness times depth."""

    @property
    @abstractmethod
    def stiffness_N_mm(self) -> float:
        """Force per depth at rest."""

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """k x."""
        return self.stiffness_N_mm * depth_mm

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """k."""
        return np.full_like(depth_mm, self.stiffness_N_mm)

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """F/k."""
        return force_N / self.stiffness_N_mm


def straight(depth_mm: FloatArray, force_N: FloatArray) -> float:
    """Stiffness [N/mm] of the line of least squares through contact."""
    return float(depth_mm @ force_N / (depth_mm @ depth_mm))


def depth_rising(force_at: Callable[[FloatArray], FloatArray], force_N: FloatArray, deepest_mm: float) -> FloatArray:
    """The depths at which ``force_at`` has risen to the force from contact; where it never does, those of its top."""
    places_mm = np.linspace(0.0, deepest_mm, PLACES)
    with np.errstate(over="ignore", invalid="ignore"):
        falls = np.flatnonzero(np.diff(force_at(places_mm)) < 0)
    top_mm = places_mm[falls[0]] if falls.size else deepest_mm
    return bisect(force_at, force_N, np.zeros_like(force_N), np.full_like(force_N, top_mm))


def bisect(
    force_at: Callable[[FloatArray], FloatArray], force_N: FloatArray, low_mm: FloatArray, high_mm: FloatArray
) -> FloatArray:
    """The depths between ``low_mm`` and ``high_mm`` at which a rising ``force_at`` is ``force_N``, all one shape."""
    for _ in range(BISECTIONS):
        middle_mm = 0.5 * (low_mm + high_mm)
        above = force_at(middle_mm) > force_N
        low_mm, high_mm = np.where(above, low_mm, middle_mm), np.where(above, middle_mm, high_mm)
    return np.asarray(0.5 * (low_mm + high_mm))


@dataclass(frozen=True, kw_only=True)
class Constant(Linear, Damped):
    """Kelvin-Voigt, a spring beside a damper: F = k x + B v (equation 6 of the study); also called `kelvin_voigt`.

    It jumps by B v at contact and would pull on the way out, which tissue does not; k is secant and tangent alike.
    """

    name: ClassVar[str] = "constant"
    formula: ClassVar[str] = "F = k x + B v"

    k_N_mm: Annotated[float, ParameterBounds("N/mm", 1e-6, 1e4, "stiffness")]

    @property
    def stiffness_N_mm(self) -> float:
        """k."""
        return self.k_N_mm

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """The line through contact and the data's centre of least squares."""
        return {"k_N_mm": straight(depth_mm, force_N)}


@dataclass(frozen=True, kw_only=True)
class Index(Damped):
    """The study's index model: secant stiffness k(x) = a exp(b x) (equation 5), hence F = a x exp(b x) + B v.

    The tangent is a (1 + b x) exp(b x): a loop that takes the secant for it reads the plant's gain low by 1 + b x.
    The inverse is x = W(b F / a) / b with Lambert's W (Corless et al. 1996, "On the Lambert W function").
    """

    name: ClassVar[str] = "index"
    formula: ClassVar[str] = "F = a x exp(b x) + B v"

    a_N_mm: SecantAtContact
    b_per_mm: Annotated[float, ParameterBounds("1/mm", 0.0, 5.0, "stiffening per depth")]

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """The straight line ln(F/x) = ln a + b x, weighted with force."""
        slope, level = np.polyfit(depth_mm, np.log(force_N / depth_mm), 1, w=force_N)
        return {"a_N_mm": float(np.exp(level)), "b_per_mm": float(slope)}

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """a x exp(b x)."""
        return index_force(depth_mm, self.a_N_mm, self.b_per_mm)

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
