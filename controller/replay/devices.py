"""Devices that give what a recording holds of them, up to the sample that each cycle was decided on."""

from collections.abc import Sequence
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from controller.devices.health import NEVER_NS
from drivers.roles import Identity, LinkCounters
from rig.channels import AxisSample, ForceSample, MarkerSample
from rig.errors import DeviceError

Sample = TypeVar("Sample", ForceSample, AxisSample, MarkerSample)


class RecordedStream(Generic[Sample]):
    """``upto`` says which sample is the newest of the next ``poll``; ``lost`` why there are none any more."""

    def __init__(self, kind: type[Sample], rows: NDArray[np.void], period_ns: int, tools: tuple[str, ...] = ()) -> None:
        self.counters, self.next_seq = LinkCounters(), 0
        self.identity, self.period_ns, self.tools = Identity("recorded", "", ""), period_ns, tools
        self.lost = ""
        self._samples: list[Sample] = [kind(*row) for row in rows.tolist()]
        self._captures_ns = np.maximum.accumulate(rows["capture_ns"]) if rows.size else np.empty(0, np.int64)
        self._given = self._upto = 0

    def upto(self, now_ns: int, age_ns: int) -> None:
        """The cycle at ``now_ns`` found the newest sample ``age_ns`` old."""
        if age_ns < NEVER_NS // 2:
            self._upto = int(np.searchsorted(self._captures_ns, now_ns - age_ns, "right"))

    def start(self) -> None:
        """There is nothing to start."""

    def fileno(self) -> int:
        """There is nothing to wait for."""
        return -1

    def close(self) -> None:
        """There is nothing to close."""

    def poll(self, now_ns: int) -> Sequence[Sample]:  # noqa: ARG002 - what is due was said by ``upto``
        """What the recorded cycle had not yet taken."""
        if self.lost:
            raise DeviceError(self.lost)
        given, self._given = self._given, max(self._given, self._upto)
        return self._samples[given : self._given]


class RecordedAxis(RecordedStream[AxisSample]):
    """An axis that goes where it went, whatever it is told; ``fault`` is what the drive reported."""

    def __init__(self, rows: NDArray[np.void], period_ns: int) -> None:
        super().__init__(AxisSample, rows, period_ns)
        self.fault, self.enabled, self.referenced = "", True, True

    def home(self) -> None:
        """It is where it is."""

    def move_to(self, position_mm: float, speed_mm_s: float) -> None:
        """Likewise."""

    def enable(self) -> None:
        """It is, as far as rows tell."""

    def command(self, position_mm: float, now_ns: int) -> None:
        """What it was told stands in the rows that are compared."""

    def request(self, now_ns: int) -> None:
        """What it answers is recorded."""

    def quick_stop(self) -> None:
        """It stood still if it did."""

    def power_off(self) -> None:
        """Likewise."""

    def history(self) -> tuple[str, ...]:
        """Nobody asks."""
        return ()

    def reset_fault(self) -> None:
        """Nobody resets."""
