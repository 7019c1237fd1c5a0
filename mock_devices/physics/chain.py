"""Where in the bench a hidden effect can stand: one small base class a place, and the chain that holds what is on.

Places follow the path of the signal: axis -> kinematics -> surface -> tissue -> guide -> sensor -> time stamps. A place
with nothing in it costs the bench an empty loop.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple


class Knob(NamedTuple):
    """One parameter of an effect; its name carries the unit."""

    default: float
    low: float
    high: float
    meaning: str


def knob(default: float, low: float, high: float, meaning: str) -> float:
    """A parameter of an effect, as a dataclass field."""
    return field(default=default, metadata={"knob": Knob(default, low, high, meaning)})


@dataclass
class HiddenEffect:
    """An operator in the chain; its dataclass fields made by ``knob`` are its parameters."""


class Kinematic(HiddenEffect, ABC):
    """Between encoder and tip."""

    @abstractmethod
    def __call__(self, position_mm: float, contact_N: float) -> float:
        """Position of the tip's side, given that of the axis' side."""


class Shift(HiddenEffect, ABC):
    """Moves the surface."""

    @abstractmethod
    def __call__(self, time_s: float, touching: bool) -> float:
        """Millimetres added to the surface's position."""


class Elastic(HiddenEffect, ABC):
    """Replaces the elastic law."""

    @abstractmethod
    def __call__(self, law: Callable[[float], float], depth_mm: float) -> float:
        """Newtons at ``depth_mm``, where ``law`` is the index law."""


class Factor(HiddenEffect, ABC):
    """Multiplies the elastic force; called in contact only."""

    @abstractmethod
    def __call__(self, depth_mm: float, time_s: float) -> float:
        """The factor."""


class Viscous(HiddenEffect, ABC):
    """Replaces the viscous term."""

    @abstractmethod
    def __call__(self, speed_mm_s: float, elastic_N: float) -> float:
        """Newtons at ``speed_mm_s`` into the tissue, given the elastic force now."""


class Hereditary(HiddenEffect, ABC):
    """Adds a force with a past; called at every step."""

    @abstractmethod
    def __call__(self, elastic_N: float) -> float:
        """Newtons to add, given the elastic force now."""


class Pull(HiddenEffect, ABC):
    """Adds a force that may be tensile; called at every step."""

    @abstractmethod
    def __call__(self, depth_mm: float, speed_mm_s: float, present: bool) -> float:
        """Newtons to add, below zero for tension."""


class Guide(HiddenEffect, ABC):
    """Between tip and sensor."""

    @abstractmethod
    def __call__(self, moved_mm: float, acceleration_mm_s2: float) -> float:
        """Newtons the sensor sees besides the contact."""


class Sensing(HiddenEffect, ABC):
    """On the way of the force to the converter; called at every step."""

    @abstractmethod
    def __call__(self, force_N: float) -> float:
        """The force as it comes out."""


class Conversion(HiddenEffect, ABC):
    """In the converter; called once a sample."""

    @abstractmethod
    def __call__(self, force_N: float, time_s: float, temperature_C: float) -> float:
        """The force as converted."""


class Late(HiddenEffect):
    """Delays the camera."""

    delay_s: float


@dataclass(frozen=True)
class Chain:
    """Effects that are on, each at its place."""

    kinematics: tuple[Kinematic, ...] = ()
    surface: tuple[Shift, ...] = ()
    elastic: Elastic | None = None
    factors: tuple[Factor, ...] = ()
    viscous: Viscous | None = None
    memories: tuple[Hereditary, ...] = ()
    pulls: tuple[Pull, ...] = ()
    guide: tuple[Guide, ...] = ()
    sensing: tuple[Sensing, ...] = ()
    readings: tuple[Conversion, ...] = ()
    camera_delay_s: float = 0.0

    @property
    def acts_in_air(self) -> bool:
        """Whether the tissue has to be asked out of contact too."""
        return bool(self.memories or self.pulls)

    @classmethod
    def of(cls, effects: Iterable[HiddenEffect]) -> "Chain":
        """The chain of ``effects``, which stand in the order of the library."""
        on = list(effects)
        return cls(
            kinematics=tuple(effect for effect in on if isinstance(effect, Kinematic)),
            surface=tuple(effect for effect in on if isinstance(effect, Shift)),
            elastic=next((effect for effect in on if isinstance(effect, Elastic)), None),
            factors=tuple(effect for effect in on if isinstance(effect, Factor)),
            viscous=next((effect for effect in on if isinstance(effect, Viscous)), None),
            memories=tuple(effect for effect in on if isinstance(effect, Hereditary)),
            pulls=tuple(effect for effect in on if isinstance(effect, Pull)),
            guide=tuple(effect for effect in on if isinstance(effect, Guide)),
            sensing=tuple(effect for effect in on if isinstance(effect, Sensing)),
            readings=tuple(effect for effect in on if isinstance(effect, Conversion)),
            camera_delay_s=sum(effect.delay_s for effect in on if isinstance(effect, Late)),
        )
