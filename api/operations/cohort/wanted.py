"""What is asked of a cohort; loads nothing, so that a command can say its help at once."""

from dataclasses import dataclass
from typing import Literal

Work = Literal["fit", "diagnose", "report"]
Simulation = Literal["index", "constant"]
By = Literal["specimen", "site", "operator", "recording"]


@dataclass(frozen=True)
class Wanted:
    """What is done with each session, or with each of its parts where ``by`` says what tells them apart: the options
    that ``work`` has for one.
    """

    work: Work
    laws: tuple[str, ...] = ()
    known: tuple[tuple[str, float], ...] = ()
    model: str = "index"
    simulation: Simulation = "index"
    detectability: bool = False
    only: str = ""
    by: By | None = None
