"""What `rig fit` found: laws compared on a session's curves, and the lattice where it was asked for."""

from collections.abc import Mapping
from typing import Literal

from pydantic import ConfigDict, Field

from rig.results.base import Number, Result, SavedResult
from rig.tissue.summary import ControlRow, IndexFit, KPoint, RateTest, Row, Skipped, SpeedSummary
from rig.trials.findings import Finding

FOLDER, FILE, MODEL = "fit", "fit.json", "model.json"
PICTURES = ("fit", "residuals", "lattice")


class DisplacementErrors(Result):
    """Largest |predicted - measured displacement| over trials and given forces, and the force residual."""

    max_error_mm: Number
    max_error_percent: Number
    rmse_N: float
    rows: tuple[Row, ...] = Field(default=(), description="one a given force; empty in files of earlier versions")


class HeldOut(Result):
    """Errors on what the law was not fitted to; null where nothing could be left out."""

    trials: DisplacementErrors | None
    speeds: DisplacementErrors | None
    subjects: DisplacementErrors | None


class ParameterResult(Result):
    """A parameter of a fitted law; ``known``: it was given, not fitted."""

    value: float
    unit: str
    standard_error: float
    interval: tuple[float, float]
    at_bound: bool
    known: bool


class LawResult(DisplacementErrors):
    """A fitted law; its own errors are those on the curves fitted."""

    formula: str
    parameters: Mapping[str, ParameterResult]
    interval_level: float
    interval_method: str
    held_out: HeldOut
    control: tuple[ControlRow, ...] = Field(
        description="what the law means to a force loop, at each given force that it reaches"
    )

    @property
    def worst_percent(self) -> float | None:
        """Its largest error of a displacement, of trials left out where there are several."""
        return (self.held_out.trials or self).max_error_percent


class LatticeSweep(Result):
    """Reaction over spring stiffness, phi(d) = R/k, of the block at each depth; ``intact``: no cell collapsed."""

    depth_mm: tuple[float, ...]
    force_over_k_mm: tuple[float, ...]
    intact: tuple[bool, ...]


class PerSpringResult(Result):
    """The fit with stiffness a exp(b |strain|) in each spring, checked with the whole block."""

    law: str = Field(description="its name in `models`")
    depth_mm: tuple[float, ...]
    quarter_force_over_k_mm: tuple[float, ...]
    whole_force_over_k_mm: tuple[float, ...]
    agrees_to_mm: float
    doubt: str | None


class LatticeResult(Result):
    """The mass-spring lattice on the curves of a study: k for each force, the index law through them, alternatives."""

    vertices: tuple[int, int, int]
    spacing_mm: float
    tip_diameter_mm: float
    contact: str
    sides: str
    mode: Literal["study", "stabilised"]
    collapse: str | None
    phi: LatticeSweep
    points: tuple[KPoint, ...]
    index: IndexFit
    models: Mapping[str, LawResult] = Field(description="laws on the lattice and others, on the same curves")
    per_spring: PerSpringResult | None


class FitResult(SavedResult):
    """Laws compared on the curves of one or more sessions; each law stands under its name."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, LawResult] = Field(init=False)

    session: str
    trials: tuple[str, ...]
    skipped: tuple[Skipped, ...]
    speeds: tuple[SpeedSummary, ...]
    force_N: tuple[float, ...] = Field(description="the given forces, at which errors are taken")
    closest: str = Field(description="the law with the smallest residual, whose contact all displacements count from")
    rate: RateTest | None
    model: str = Field(description="the model file that was written")
    model_law: str = Field(description="the law that file holds")
    known: Mapping[str, float] = Field(description="parameters that were given")
    recordings: Mapping[str, str] = Field(description="SHA-256 of each recording the fit was made from")
    remarks: tuple[str, ...] = Field(default=(), description="what the curves cannot tell")
    lattice: LatticeResult | None = None
    data_quality: tuple[Finding, ...] = Field(default=(), description="samples of the trials that were left out")

    @property
    def laws(self) -> dict[str, LawResult]:
        """The laws compared, by name, in the order asked for."""
        return self.__pydantic_extra__
