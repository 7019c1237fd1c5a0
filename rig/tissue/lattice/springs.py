"""Laws of one spring and of one cell, and the two modes of the lattice."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rig.errors import UsageError
from rig.tissue.lattice.kernels import Stiffness

Mode = Literal["study", "stabilised"]
LARGEST_EXPONENT = 40.0  # twice the 17 of the demonstration's session; a spring stretched by half is then e^20 stiffer


@dataclass(frozen=True)
class Springs:
    """Every spring pulls with T = k exp(b |e|) (r - L), e = r/L - 1; b = 0 is the study's constant spring.

    Energy k L^2 [(b|e| - 1) exp(b|e|) + 1] / b^2, tangent k exp(b|e|) (1 + b|e|). ``cell_ratio`` = kv / k scales the
    volume term kv d^2 (J - 1 - ln J) of each cell, J from the mean edges of the cell; 0 is the study's lattice, which
    collapses. Small strains (b plays no part): lambda = (k + kv)/d, G = k/d, so nu = (1 + c)/(2 (2 + c)) with c = kv/k:
    1/4 without the volume term, 1/3 with c = 1.
    """

    k_N_mm: float = 0.1
    b: float = 0.0
    cell_ratio: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.k_N_mm) and self.k_N_mm > 0.0):
            raise UsageError(f"spring stiffness k = {self.k_N_mm} N/mm must be a number above 0 N/mm")
        if not 0.0 <= self.b <= LARGEST_EXPONENT:
            raise UsageError(f"spring exponent b = {self.b} must lie between 0 (constant) and {LARGEST_EXPONENT:g}")
        if not 0.0 <= self.cell_ratio <= 1000.0:
            raise UsageError(
                f"cell stiffness over spring stiffness = {self.cell_ratio} must lie between 0 (study) and 1000"
            )

    @classmethod
    def for_mode(cls, mode: Mode, k_N_mm: float = 1.0, b: float = 0.0) -> "Springs":
        """Springs only (``study``) or with the cell-volume term (``stabilised``)."""
        return cls(k_N_mm, b, 0.0 if mode == "study" else 1.0)

    @property
    def mode(self) -> Mode:
        """Whether cells are kept from inverting."""
        return "stabilised" if self.cell_ratio > 0.0 else "study"

    def for_kernels(self, spacing_mm: float) -> Stiffness:
        """The numbers the compiled loops read."""
        return Stiffness(self.k_N_mm, self.b, self.cell_ratio * self.k_N_mm * spacing_mm**2, spacing_mm)
