"""What a fault of the campaign is: where it happens, what brings it about, and what must notice it, how soon."""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.faults.scenarios import Truth
from controller.safety.table import TABLE, Check
from controller.supervisor import Supervisor
from mock_devices.testing.commands import ServedBench, children

DRIVE = "drive_guard"
"""The drive itself: it misses our heartbeats, stops and brakes."""
PROTOCOL = "protocol"
"""A step that meets what it cannot go on with: no contact, a zero that has moved."""
NOBODY = ""
"""Nothing is wrong: whoever notices something, and any verdict but good, is a failure."""
REFUSED = "refused"
"""Nothing moves at all: configuration, calibration or message is turned down in one sentence."""
QUALITY = "quality"
"""Motion goes on, the trial's quality names the disturbance, and its verdict is no longer good."""

# Two periods of the heartbeat (50 ms each), the ramp from the fastest press, the brake (15 ms), one look at it.
DRIVE_S = 0.25
# The step has been entered when its fault is brought about; what it raises it raises in its next cycles.
PROTOCOL_S = 0.5


@dataclass(frozen=True)
class Live:
    """What a fault acts on: the bench, the program that runs it, its process number, and its foot switch (a FIFO)."""

    bench: ServedBench
    pid: int
    rig: Supervisor | None = None
    keypad: Path = Path()

    @property
    def supervisor(self) -> Supervisor:
        """The program's supervisor, where it runs in this process."""
        assert self.rig, "this fault needs a supervisor in this process"
        return self.rig

    def child(self, module: str) -> int:
        """Process number of the program's child that runs ``module``."""
        (pid,) = children(self.pid, module)
        return pid

    @property
    def other(self) -> bool:
        """Whether the program is another process than this one."""
        return self.pid != os.getpid()


Act = Callable[[Live], None]
Onset = Callable[[Truth], bool]


def at_once(_: Truth) -> bool:
    """The bound counts from the fault itself."""
    return True


@dataclass(frozen=True)
class Fault:
    """One declared fault.

    ``expected`` are the codes that may notice it: lines of the table, or one of the four above. Their bound counts from
    the first moment after the fault at which ``onset`` holds for the bench's true figures. ``before``: it is brought
    about when the bench has started and no program yet. ``settings`` are of the wiring. Its moment is drawn from 0 to
    ``latest_s`` after the scenario is ready for it. ``apart``: the program that runs the bench is a process of its own.
    ``keypad``: there is a foot switch. ``freezes``: stalls are its own doing. ``named`` are the measures of quality
    that may name it. ``within_s`` replaces the bound of the table where the program outside the loop notices first.
    ``stream``: a share of its messages is damaged, and when one of them is one too many is chance; the bound counts
    from the last sample that came.
    ``why`` says what it stands for, where its name does not.
    """

    name: str
    scenario: str
    expected: tuple[str, ...]
    act: Act
    onset: Onset = at_once
    settings: tuple[str, ...] = ()
    before: bool = False
    latest_s: float = 1.5
    apart: bool = False
    within_s: float | None = None
    named: tuple[str, ...] = ()
    keypad: bool = False
    freezes: bool = False
    stream: str = ""
    why: str = ""


def bounds(table: tuple[Check, ...] = TABLE) -> dict[str, float]:
    """The longest time from fault to reaction that is accepted, by code [s]; infinite where nothing has to stop."""
    others = {DRIVE: DRIVE_S, PROTOCOL: PROTOCOL_S, REFUSED: math.inf, QUALITY: math.inf, NOBODY: math.inf}
    return {line.code: line.bound_s for line in table} | others


def bound_s(fault: Fault, code: str) -> float:
    """How soon ``code`` has to notice ``fault``."""
    return bounds()[code] if fault.within_s is None else fault.within_s
