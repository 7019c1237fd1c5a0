"""From one line of `rig.toml` to the driver that fills the role."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TypeVar

from controller.devices.guard import GuardedAxis, GuardedForce, GuardedTracker
from controller.devices.reopening import Open, Openers
from drivers.epos4.walker import never
from drivers.roles import Device, ForceSensor, MarkerTracker, ServoAxis
from rig.config.products.roles import AxisProduct, ForceProduct, TrackerProduct
from rig.config.wiring import Limits, Wiring

Interrupted = Callable[[], bool]
Started = TypeVar("Started", bound=Device)


@dataclass(frozen=True)
class Devices:
    """The devices of one bench; ``tracker`` may be absent."""

    force: ForceSensor
    axis: ServoAxis
    tracker: MarkerTracker | None

    def by_role(self) -> dict[str, Device]:
        """Those there are, by the name of their role."""
        roles: dict[str, Device] = {"force": self.force, "axis": self.axis}
        return roles | ({"tracker": self.tracker} if self.tracker else {})

    def close(self) -> None:
        """Leaves all of them safe, the axis first."""
        self.axis.close()
        self.force.close()
        if self.tracker:
            self.tracker.close()


def open_force(config: ForceProduct) -> ForceSensor:
    """The force sensor, not yet started; raises DeviceError where its port cannot be opened."""
    return GuardedForce.guard(config, lambda: resolve_name(config.driver)(config))


def open_axis(config: AxisProduct, limits: Limits, rate_Hz: float, interrupted: Interrupted = never) -> ServoAxis:
    """The servo axis, not yet started, to be asked for a sample ``rate_Hz`` times a second.

    ``interrupted`` is asked while it moves by itself; a yes brakes it.
    """
    options = {"rate_Hz": rate_Hz, "interrupted": interrupted}
    return GuardedAxis.guard(config, lambda: resolve_name(config.driver)(config, limits, **options))


def open_tracker(config: TrackerProduct) -> MarkerTracker:
    """The tracker, not yet started."""
    return GuardedTracker.guard(config, lambda: resolve_name(config.driver)(config))


class Interruption:
    """Whether the axis, while it moves by itself, is to be braked: asks ``source``, which is whoever looks just now."""

    def __init__(self) -> None:
        self.source: Interrupted = never

    def __call__(self) -> bool:
        """The answer of now."""
        return self.source()


def openers(wiring: Wiring, interrupted: Interrupted = never) -> Openers:
    """How each device of the bench is opened again."""
    by_role: dict[str, Open] = {
        "force": lambda: open_force(wiring.force),
        "axis": lambda: open_axis(wiring.axis, wiring.limits, wiring.loop.rate_Hz, interrupted),
    }
    tracker = wiring.tracker
    return Openers(by_role | ({"tracker": lambda: open_tracker(tracker)} if tracker else {}))


def start_devices(wiring: Wiring, interrupted: Interrupted = never) -> Devices:
    """Opens and starts all devices; on any failure those already open are closed again, and DeviceError is raised."""
    with ExitStack() as opened:
        force = started(open_force(wiring.force), opened)
        axis = started(open_axis(wiring.axis, wiring.limits, wiring.loop.rate_Hz, interrupted), opened)
        tracker = started(open_tracker(wiring.tracker), opened) if wiring.tracker else None
        opened.pop_all()
    return Devices(force, axis, tracker)


def started(device: Started, opened: ExitStack) -> Started:
    """The device, which is closed with ``opened``, also where it does not start."""
    opened.callback(device.close)
    device.start()
    return device
