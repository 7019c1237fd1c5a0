"""The index law with what a diagnosis found missing in it; each part is off at its null."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, ClassVar

import numpy as np

from rig.tissue.history import Term
from rig.tissue.index_law import extended_force
from rig.tissue.laws import Damped, FloatArray, Index, ParameterBounds, SecantAtContact, bisect, depth_rising
from rig.tissue.laws_viscous import Tau

DEEPEST_MM = 200.0  # no limb is thicker
STEP_MM = 1e-5  # near the cube root of double precision, where a central difference errs least


@dataclass(frozen=True, kw_only=True)
class Extended(Damped):
    """The index law, or another form in its place, with relaxation, behind a compliant frame and linear-guide friction.

    Depth is what the encoder shows: the tip is behind it by compliance times force. Friction (Dahl's, with its level
    and the travel over which it builds up) is a matter of direction and no part of the force at rest.
    """

    name: ClassVar[str] = "extended"
    formula: ClassVar[str] = (
        "F = int (1 + r exp(-(t-s)/tau)) d[a x exp(b x) (x / 5 mm)^(n-1) (1 + q x) (1 + s x^3) f(x)] + B v, "
        "x = depth - c F, f: (exp(k x) - 1)/(k x) of Fung, that of Ogden's block, or of a sphere on a layer"
    )
    known: ClassVar[Mapping[str, float]] = {
        "exponent": 1.0, "quadratic_per_mm": 0.0, "substrate_per_mm3": 0.0, "relaxation_ratio": 0.0, "tau_s": 1.0,
        "frame_compliance_mm_N": 0.0, "friction_N": 0.0, "friction_length_mm": 0.1, "fung_per_mm": 0.0,
        "ogden_per_mm": 0.0, "ogden_exponent": 4.0, "layer_ratio": 0.0,
    }  # fmt: skip
    later: ClassVar[tuple[str, ...]] = ("fung_per_mm", "ogden_per_mm", "ogden_exponent", "layer_ratio")

    a_N_mm: SecantAtContact
    b_per_mm: Annotated[float, ParameterBounds("1/mm", -0.5, 5.0, "stiffening per depth")]
    exponent: Annotated[float, ParameterBounds("1", 0.2, 4.0, "exponent")] = 1.0
    quadratic_per_mm: Annotated[float, ParameterBounds("1/mm", -0.15, 50.0, "polynomial stiffening")] = 0.0
    substrate_per_mm3: Annotated[float, ParameterBounds("1/mm^3", 0.0, 0.05, "stiffening by what lies below")] = 0.0
    relaxation_ratio: Annotated[float, ParameterBounds("1", 0.0, 30.0, "force that relaxes over force at rest")] = 0.0
    tau_s: Tau = 1.0
    frame_compliance_mm_N: Annotated[float, ParameterBounds("mm/N", 0.0, 0.8, "compliance of the frame")] = 0.0
    friction_N: Annotated[float, ParameterBounds("N", 0.0, 20.0, "friction of the guide in front of the sensor")] = 0.0
    friction_length_mm: Annotated[float, ParameterBounds("mm", 1e-3, 10.0, "travel in which friction builds up")] = 0.1
    fung_per_mm: Annotated[float, ParameterBounds("1/mm", 0.0, 5.0, "rate of Fung's exponential")] = 0.0
    ogden_per_mm: Annotated[float, ParameterBounds("1/mm", 0.0, 0.5, "one over the thickness of Ogden's block")] = 0.0
    ogden_exponent: Annotated[float, ParameterBounds("1", 1.05, 40.0, "exponent of the stretch")] = 4.0
    layer_ratio: Annotated[float, ParameterBounds("1", 0.0, 8.0, "contact radius over layer thickness at 5 mm")] = 0.0

    @classmethod
    def near(cls, depth_mm: FloatArray, force_N: FloatArray) -> dict[str, float]:
        """The index law's guess, nothing extended."""
        return {**cls.known, **asdict(Index.guess(depth_mm, force_N))}

    @property
    def terms(self) -> tuple[Term, ...]:
        """One, where the tissue relaxes."""
        return (Term(self.relaxation_ratio, self.tau_s),) if self.relaxation_ratio else ()

    @property
    def friction(self) -> tuple[float, float]:
        """Level [N] and length [mm]."""
        return self.friction_N, self.friction_length_mm

    def elastic(self, depth_mm: FloatArray) -> FloatArray:
        """The tissue's force; with a compliant frame where tissue and frame carry the same."""
        c_mm_N = self.frame_compliance_mm_N
        if not c_mm_N:
            return self._tissue(depth_mm)
        tip_mm = bisect(lambda x: x + c_mm_N * self._tissue(x), depth_mm, np.zeros_like(depth_mm), depth_mm)
        return self._tissue(tip_mm)

    def _tissue(self, tip_mm: FloatArray) -> FloatArray:
        return extended_force(tip_mm, vars(self))

    def slope(self, depth_mm: FloatArray) -> FloatArray:
        """Central difference; one-sided at contact."""
        low_mm = np.maximum(depth_mm - STEP_MM, 0.0)
        high_mm = depth_mm + STEP_MM
        return np.asarray((self.elastic(high_mm) - self.elastic(low_mm)) / (high_mm - low_mm))

    def elastic_inverse(self, force_N: FloatArray) -> FloatArray:
        """The tip's depth by bisection, as far as force rises, and how far the frame gives way."""
        force = np.asarray(force_N, float)
        tip_mm = depth_rising(self._tissue, force, DEEPEST_MM)
        return np.asarray(tip_mm + self.frame_compliance_mm_N * force)
