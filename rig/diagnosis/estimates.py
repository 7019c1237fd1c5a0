"""What a diagnosis says in numbers: causes with sizes, intervals and gains; no science is loaded to read them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Verdict = Literal["adequate", "explained", "unexplained"]


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval; ``at_bound`` where the fit was stopped by a bound and says little of the size."""

    value: float
    low: float
    high: float
    at_bound: bool = False


@dataclass(frozen=True)
class ErrorGain:
    """Error on recordings left out, before and after, and the relative reduction with its 95 % interval."""

    rmse_before_N: float
    rmse_after_N: float
    reduction: float
    low: float
    high: float


@dataclass(frozen=True)
class NamedCause:
    """One named cause; further names in ``effects`` are those the data cannot tell from the first."""

    effects: tuple[str, ...]
    statement: str
    confidence: float
    parameters: Mapping[str, Estimate]
    gain: ErrorGain
    evidence_nats: float
    p_value: float
    repair: str
    provisional: bool


@dataclass(frozen=True)
class Unexplained:
    """What the error still depends on once all named causes are in the simulation, and the p value of that."""

    depends_on: tuple[str, ...]
    p_value: float | None


@dataclass(frozen=True)
class SmallestSize:
    """The size from which a cause would have been named with 80 % probability."""

    minimum: float
    unit: str


@dataclass(frozen=True)
class NextExperiment:
    """What to record next, which pair of causes that separates, how fast, and the rate of every block on the menu."""

    do: str
    separates: tuple[str, ...] = ()
    nats_per_minute: float | None = None
    menu: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SimulationError:
    """Closed-loop force error [%] of one recording, before and after; ``fitted`` if its data chose the model."""

    recording: str
    fitted: bool
    before_percent: float
    after_percent: float
