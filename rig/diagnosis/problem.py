"""What the engine knows of a system: channels, a predictor, parameters, and effects as ways to leave a null value."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rig.simulation.chain import Operator
from rig.tissue.index_law import Fields

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Values = Mapping[str, float]
TISSUE_STAGES = frozenset({"elastic", "relaxing", "viscous"})


@dataclass(frozen=True)
class Par:
    """A parameter: null value (where its effect vanishes), bounds, and the step that is small but visible.

    ``least`` is the smallest effect of interest, a distance from null: less is never named, however significant.
    ``may_end`` allows a shape to stand on its bound, where that is a limiting case and no failure.
    """

    name: str
    unit: str
    null: float
    low: float
    high: float
    scale: float
    log: bool = False
    least: float = 0.0
    may_end: bool = False
    meaning: str = ""


@dataclass(frozen=True)
class Effect:
    """A cause that can be switched on.

    ``amplitudes`` leave their null linearly; ``shapes`` (time constants, lengths, frequencies) mean nothing without
    them. ``shape_starts(problem, values, residual)`` gives the shapes to try; where it picks them from a scan of the
    residual, ``tries`` is how many independent ones it scanned, and their logarithm is taken off the evidence.
    ``begin`` is a second place to start from, far from null, where the way from null leads into a wrong valley.
    ``one_sided`` effects exist only above their null. ``between`` effects differ between recordings rather than inside
    them, so that without them they pass for scatter: they are always tried with a scatter of their own; ``mean_of`` is
    the scatter whose mean an effect is. ``beside`` names the cause without which it means nothing: it is looked for
    once that is found. ``through`` names the one variable an effect acts through, if it is one: two such together may
    imitate a third that is unknown. ``holds`` are parameters of the simulation that stay at their null beside it: it is
    another law and no step away from this one, so it is fitted in place of what was named, and never sought.
    ``operator`` is what it does in the simulation, None where it is a parameter of the elastic law. ``control`` says
    what it means for the control.
    """

    name: str
    statement: str
    amplitudes: tuple[Par, ...]
    shapes: tuple[Par, ...] = ()
    shape_starts: Callable[["InverseProblem", Values, Array], Sequence[Values]] = lambda *_: ({},)
    tries: Callable[["InverseProblem"], float] = lambda _: 1.0
    begin: Values = field(default_factory=dict)
    one_sided: bool = False
    between: bool = False
    mean_of: str = ""
    beside: str = ""
    through: str = ""
    holds: frozenset[str] = frozenset()
    operator: Operator | None = None
    control: str = "kept, and not used: it is no part of what the axis must do for a force"
    needs: frozenset[str] = frozenset()
    repair: str = ""

    @property
    def key(self) -> str:
        """Unlike the name different for the variants of one cause."""
        return self.amplitudes[0].name

    @property
    def pars(self) -> tuple[Par, ...]:
        """Amplitudes, then shapes."""
        return self.amplitudes + self.shapes

    @property
    def is_elastic(self) -> bool:
        """Whether it is another form of the tissue's law at rest."""
        return self.operator is None

    @property
    def is_of_rate(self) -> bool:
        """Whether it is what the tissue makes of time and speed."""
        return self.operator is not None and self.operator.stage in {"relaxing", "viscous"}

    @property
    def is_of_bench(self) -> bool:
        """Whether it acts inside a recording, on the force, and no tissue of any form or memory can do the same."""
        lies_in_tissue = self.operator is None or self.operator.stage in TISSUE_STAGES
        return not (lies_in_tissue or self.between or "tracker" in self.needs)


def operators(causes: Iterable[Effect], values: Fields) -> list[Operator]:
    """What the causes that are off their null do, in their order; one that several share acts once."""
    known = (cause.operator for cause in causes if any(values[par.name] != par.null for par in cause.amplitudes))
    return list(dict.fromkeys(operator for operator in known if operator))


class Signal(NamedTuple):
    """One measured signal: name, unit, readings and the recording of each, shape (n,).

    Noise may remember at most ``memory`` samples; what lasts longer is an error to be explained.
    """

    name: str
    unit: str
    observed: Array
    recording: Index
    memory: float = float("inf")


class Scatter(NamedTuple):
    """A quantity that differs by chance from recording to recording: how values change with a shift per sample."""

    name: str
    unit: str
    step: float
    nudge: Callable[[Fields, Array], Fields]


class InverseProblem(Protocol):
    """A system under criticism."""

    @property
    def title(self) -> str:
        """Name of the simulation that is judged."""

    @property
    def channels(self) -> tuple[Signal, ...]:
        """The first channel is the one whose prediction error is reported."""

    @property
    def recordings(self) -> int:
        """Units that can be left out."""

    @property
    def base(self) -> tuple[Par, ...]:
        """Parameters of the simulation as it is."""

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Causes that may be named."""

    @property
    def scatter(self) -> tuple[Scatter, ...]:
        """What varies by recording, on the first channel."""

    @property
    def offers(self) -> Mapping[str, str]:
        """Needs of effects this data cannot meet, each with the reason."""

    @property
    def labels(self) -> Mapping[str, Sequence[str]]:
        """By the name of each label of the recordings, what it is for each of them."""

    def start(self) -> Values:
        """First guess of the base parameters."""

    def predict(self, values: Fields) -> tuple[Array, ...]:
        """One array per channel; parameters not given are at their null."""

    def blind(self, values: Fields) -> NDArray[np.bool_]:
        """Rows of the first channel that cannot be judged at its sampling rate (``values`` may hold arrays)."""

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of each variable."""

    def variables(self) -> Mapping[str, Array]:
        """What a residual may depend on, each on the first channel, shape (n,)."""
