"""What a diagnosis says in numbers: causes with sizes, intervals and gains; no science is loaded to read them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Verdict = Literal["adequate", "explained", "unexplained", "not judged"]
# More than chance reaches in sessions without a cause (95 %: 4 to 13 nats, `evidence.chance`).
SAFE_NATS = 20.0


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval; ``at_bound`` where the fit was stopped by a bound and says little of the size.

    ``unit`` is None in files of earlier versions.
    """

    value: float
    low: float
    high: float
    at_bound: bool = False
    unit: str | None = None


@dataclass(frozen=True)
class ErrorGain:
    """Error on recordings left out, before and after, and the relative reduction with its 95 % interval."""

    rmse_before_N: float
    rmse_after_N: float
    reduction: float
    low: float
    high: float

    @property
    def errors(self) -> tuple[float, float]:
        """Before and after."""
        return self.rmse_before_N, self.rmse_after_N

    @property
    def unit(self) -> str:
        """Of the errors."""
        return "N"


@dataclass(frozen=True)
class EffortGain:
    """The same of a drive axis, whose effort counts in ``unit``."""

    rmse_before: float
    rmse_after: float
    unit: str
    reduction: float
    low: float
    high: float

    @property
    def errors(self) -> tuple[float, float]:
        """Before and after."""
        return self.rmse_before, self.rmse_after


@dataclass(frozen=True)
class NamedCause:
    """One named cause; further names in ``effects`` are those the data cannot tell from the first.

    Evidence [nats] is a sum over recordings left out, with its standard error; None in files of earlier versions.
    ``shared_variable`` is the one that all of them act through, where no other recording of the same kind tells them
    apart.
    """

    effects: tuple[str, ...]
    statement: str
    confidence: float
    parameters: Mapping[str, Estimate]
    gain: ErrorGain | EffortGain
    evidence_nats: float
    p_value: float
    repair: str
    provisional: bool
    evidence_se_nats: float | None = None
    shared_variable: str | None = None


@dataclass(frozen=True)
class OwnSpread:
    """Standard deviation between recordings of what each has of its own."""

    sd: float
    unit: str


@dataclass(frozen=True)
class ErrorBudget:
    """Errors [N] on recordings left out, each with its own contact, zero and stiffness; None where data tell nothing.

    ``base_N`` is of the simulation as it is, where these stay as the causes named leave them, ``floor_N`` what could be
    reached, ``repeatability_N`` what repeats of one motion differ by, ``shared_by_repeats`` what their errors have in
    common, over what they differ by (power), ``explained_share`` how much of what could be taken off the error of the
    simulation as it was the causes named take off (power).
    ``stiffness_N_mm``, how force rises with depth where the tip presses, turns such an error into one of depth.
    """

    base_N: float
    extended_N: float
    flexible_N: float
    floor_N: float
    noise_N: float | None
    repeatability_N: float | None
    shared_by_repeats: Estimate | None
    explained_share: Estimate | None
    scatter: Mapping[str, OwnSpread]
    stiffness_N_mm: float | None = None


@dataclass(frozen=True)
class Unexplained:
    """What the error still depends on once all named causes are in the simulation, and the p value of that."""

    depends_on: tuple[str, ...]
    p_value: float | None


@dataclass(frozen=True)
class SmallestSize:
    """The size from which a cause would have been named with 80 % probability.

    Planted at that size in the recordings themselves it was ``found`` in so many of ``trials``; without any the size is
    an estimate from the curvature of the fit.
    """

    minimum: float
    unit: str
    found: int = 0
    trials: int = 0


@dataclass(frozen=True)
class NextExperiment:
    """What to record next, which pair of causes that separates, how fast, and the rate of every block on the menu."""

    do: str
    separates: tuple[str, ...] = ()
    nats_per_minute: float | None = None
    menu: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SimulationError:
    """Closed-loop force error [%] of one recording, before and after; ``fitted`` if its data chose the model.

    ``reference_percent`` is that of models of others, by name, in the same simulator.
    """

    recording: str
    fitted: bool
    before_percent: float
    after_percent: float
    reference_percent: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class AxisPrediction:
    """What an axis is counted in, how its recordings were predicted, and the error of that.

    ``left_out_percent`` is 100 |effort - simulated| / |effort| of the model found, over all recordings left out; None
    without any, or without a controller to simulate them with. ``explained_share`` is that of an `ErrorBudget`, over
    blocks left out by inverse dynamics.
    """

    method: Literal["closed loop", "inverse dynamics"]
    effort_unit: str
    position_unit: str
    left_out_percent: float | None
    explained_share: Estimate | None = None
