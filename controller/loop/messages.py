"""What supervisor and loop say to each other over their channel, and how a program ended."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from pydantic import Field
from typing_extensions import TypedDict

from controller.loop.carried import UNZEROED, Carried
from controller.loop.paired_samples import Touch
from controller.loop.steps import Program
from controller.recovery.situation import Situation
from rig.channel import Message, Reply
from rig.results.bench import Act


class DeviceFound(TypedDict, total=False):
    """Who a device says it is."""

    product: str
    serial: str
    firmware: str
    settings: dict[str, str]


class DeviceShown(TypedDict, total=False):
    """How a device is, and since when [ns]."""

    state: str
    detail: str
    since_ns: int


class DeviceView(DeviceFound, DeviceShown, total=False):
    """Who a device is, and how it is."""


class Latched(TypedDict, total=False):
    """What stopped motion; ``action`` is the name of what was done."""

    code: str
    text: str
    action: str


class Status(TypedDict, total=False):
    """The loop as of one moment, for people to see; what decides anything has a message of its own."""

    time_ns: int
    mode: str
    busy: bool
    step: int
    health: int
    missed: int
    cycles: int
    force_N: float | None
    peak_force_N: float | None
    reference_N: float | None
    position_mm: float | None
    depth_mm: float | None
    rates_Hz: dict[str, float]
    lost: dict[str, str]
    devices: dict[str, DeviceShown]
    ready: bool
    latched: Latched | None


@dataclass(frozen=True)
class Outcome:
    """How a program ended; ``wire_damage`` by role, see ``WireDamage``."""

    outcome: str
    cause: str
    peak_force_N: float
    surface_mm: float | None
    zero_N: float | None
    touch: Touch | None = None
    wire_damage: Mapping[str, float] = field(default_factory=dict)
    carried: Carried = UNZEROED

    @property
    def stopped(self) -> bool:
        """Whether a limit, a person or a fault ended it."""
        return bool(self.cause)


class Run(Message, kind=10):
    """Execute this; the id of the message is the program's, and its outcome carries it."""

    program: Program


class Reset(Message, kind=12):
    """A stop is acknowledged."""


class Note(Message, kind=13):
    """For the event stream."""

    code: str
    text: str


class Heartbeat(Message, kind=14):
    """The operator's program lives, and whether the operator is ``attending``."""

    attending: bool


class Shutdown(Message, kind=15):
    """End as soon as nothing moves."""


class Ready(Message, kind=20):
    """What the loop found when it started."""

    devices: dict[str, DeviceFound] = Field(default_factory=dict)
    realtime: dict[str, str] = Field(default_factory=dict)


class LoopFailed(Message, kind=21):
    """The loop ends; ``stopped``: because someone stopped it."""

    text: str
    stopped: bool = False


class StatusSaid(Message, kind=22):
    """The newest status."""

    status: Status


class Stopped(Message, kind=23):
    """Motion was stopped; ``action`` is the name of what was done."""

    code: str
    text: str
    action: str


class Finished(Message, kind=24):
    """The program with id ``program`` has ended."""

    program: int
    outcome: Outcome


class Survey(Message, kind=16):
    """Say how things stand, for recovery."""


class Recover(Message, kind=17):
    """Do one act of recovery."""

    act: Act


class Surveyed(Reply, kind=25):
    """How things stand."""

    situation: Situation


TO_LOOP = (Run, Reset, Note, Heartbeat, Shutdown, Survey, Recover)
FROM_LOOP = (Ready, LoopFailed, StatusSaid, Stopped, Finished, Surveyed)
