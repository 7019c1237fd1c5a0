"""Starting a bench for recovery: the axis must be there; a sensor that is not is lost from the beginning."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Never

from controller.devices.drivers import Devices, Interrupted, Started, open_axis, open_force, open_tracker, started
from drivers.epos4.walker import never
from drivers.roles import Identity, LinkCounters
from rig.config.wiring import Wiring
from rig.errors import DeviceError


class Absent:
    """In the place of a sensor that did not start: asked for samples, it says why there are none."""

    def __init__(self, why: str, rate_Hz: float) -> None:
        self.counters, self.next_seq = LinkCounters(), 0
        self.identity, self.period_ns = Identity("", "", ""), round(1e9 / rate_Hz)
        self.tools: tuple[str, ...] = ()
        self._why = why

    def start(self) -> None:
        """Raises DeviceError."""
        raise DeviceError(self._why)

    def poll(self, now_ns: int) -> Sequence[Never]:  # noqa: ARG002 - the signature of a sensor
        """Raises DeviceError."""
        raise DeviceError(self._why)

    def fileno(self) -> int:
        """Raises DeviceError."""
        raise DeviceError(self._why)

    def close(self) -> None:
        """There is nothing to close."""


def start_what_answers(wiring: Wiring, interrupted: Interrupted = never) -> Devices:
    """Opens and starts the axis, and of the sensors those that answer; raises DeviceError without an axis."""
    axis = _started(lambda: open_axis(wiring.axis, wiring.limits, wiring.loop.rate_Hz, interrupted))
    tracker = wiring.tracker
    force = _or_absent(lambda: open_force(wiring.force), wiring.force.sampled_Hz)
    return Devices(force, axis, _or_absent(lambda: open_tracker(tracker), tracker.rate_Hz) if tracker else None)


def _started(opener: Callable[[], Started]) -> Started:
    with ExitStack() as opened:
        device = started(opener(), opened)
        opened.pop_all()
    return device


def _or_absent(opener: Callable[[], Started], rate_Hz: float) -> Started | Absent:
    try:
        return _started(opener)
    except DeviceError as error:
        return Absent(str(error), rate_Hz)
