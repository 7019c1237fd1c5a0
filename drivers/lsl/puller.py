"""What a thread reads of the maker's library, which has no descriptor to wait on: samples, and at times its clock."""

import contextlib
import time
from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

from drivers.lsl.library import ClockCorrection
from rig.errors import DeviceError

WAIT_S = 0.1
# The library measures anew about every two seconds; clocks of 300 ppm drift apart by 1.5 ms meanwhile.
CORRECT_EVERY_S = 5.0

Ask = Callable[[ModuleType, Any, float], ClockCorrection]


class Pulled(NamedTuple):
    """One sample as the library gave it."""

    values: tuple[float, ...]
    stamp_s: float


class Puller:
    """``read`` waits for what comes next of ``inlet``, for `drivers.threaded_source`; raises DeviceError at its end."""

    def __init__(self, pylsl: ModuleType, inlet: Any, ask: Ask) -> None:
        self._pylsl, self._inlet, self._ask = pylsl, inlet, ask
        self._due_s = time.monotonic() + CORRECT_EVERY_S

    def read(self) -> list[Pulled | ClockCorrection]:
        """A sample, a correction, or none."""
        try:
            return [*self._sample(), *self._correction()]
        except RuntimeError as error:
            raise DeviceError(f"the stream is lost: {error}; start its program again") from error

    def _sample(self) -> list[Pulled]:
        values, stamp_s = self._inlet.pull_sample(timeout=WAIT_S)
        return [] if values is None else [Pulled(tuple(map(float, values)), float(stamp_s))]

    def _correction(self) -> list[ClockCorrection]:
        """A measurement that does not succeed leaves the one before."""
        if time.monotonic() < self._due_s:
            return []
        self._due_s = time.monotonic() + CORRECT_EVERY_S
        with contextlib.suppress(self._pylsl.util.TimeoutError):
            return [self._ask(self._pylsl, self._inlet, WAIT_S)]
        return []
