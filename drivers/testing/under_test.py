"""The driver under test, on a device that can be made to fail, and what is heard of it."""

import contextlib
import select
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from drivers.input_role import Input
from drivers.kept import KEPT, lack
from drivers.roles import ForceSensor, MarkerTracker, ServoAxis
from rig.channels import AxisSample, ForceSample, MarkerSample
from rig.config.products.roles import AxisProduct, Product
from rig.config.products.usable import refusal_of
from rig.errors import DeviceError
from rig.input_streams import InputSample

AnySample = ForceSample | AxisSample | MarkerSample | InputSample
AnyDevice = ForceSensor | ServoAxis | MarkerTracker | Input
# A cycle of the loop.
TURN_S = 0.001
# The slowest stream of a bench, a tracker at 20 Hz, then gives ten samples.
FEW_S = 0.5
# Nobody presses more often; a rate of its own is then not asked for.
ACT_NS = 50_000_000
# Devices boot: a drive or a camera answers within ten seconds, or its driver's own deadline is too short.
BACK_S = 10.0


class Nonconformity(AssertionError):
    """What the driver does not keep, in one sentence."""


class Heard(NamedTuple):
    """What came, and how long each poll took [ns]."""

    samples: list[AnySample]
    polls_ns: list[int]


def readable(device: AnyDevice, timeout_s: float) -> bool:
    """Waits until the device's descriptor turns readable; False where it does not in time."""
    return bool(select.select([device.fileno()], [], [], timeout_s)[0])


def nothing(*_: object) -> None:
    """For a device that cannot be made to fail, or gives samples by itself."""


@dataclass(frozen=True)
class UnderTest:
    """``open`` gives a new driver, not started, of the device that ``config`` describes.

    ``fault`` switches a fault of the mock by its name, as the bench's control channel does; ``damage`` are those of the
    wire that the protocol must stand. ``load`` puts a force on the sensor [N]; what the tip bears already stays.
    ``unplugs``: whether the fault `unplug` can be switched on and off. ``act`` makes an input give a sample that has no
    rate, as a press does. ``now``, ``wait`` and ``sleep`` are the time it runs in.
    """

    config: Product
    open: Callable[[], AnyDevice]
    fault: Callable[[str, bool | float], None] = nothing
    damage: tuple[str, ...] = ("drop", "corrupt", "truncate", "garbage")
    unplugs: bool = True
    load: Callable[[float], None] | None = None
    act: Callable[[], None] = nothing
    now: Callable[[], int] = time.monotonic_ns
    wait: Callable[[AnyDevice, float], bool] = field(default=readable)
    sleep: Callable[[float], None] = time.sleep

    @property
    def sampled_Hz(self) -> float | None:
        """The rate that the declaration promises; None for an axis, which answers what it is asked, and a switch."""
        return self.config.promised_Hz

    def made(self) -> AnyDevice:
        """A new driver, not started; raises Nonconformity where it or its declaration lacks what its role has."""
        if wrong := refusal_of(KEPT[self._role()].declared)(type(self.config)):
            raise Nonconformity(f"its declaration cannot be used: {wrong}")
        device = self.open()
        self._refuse_lacking(device, whole=False)
        return device

    def start(self, device: AnyDevice, next_seq: int = 0) -> None:
        """Starts it; raises Nonconformity where it then lacks a member of its role."""
        device.next_seq = next_seq
        device.start()
        self._refuse_lacking(device, whole=True)

    def _refuse_lacking(self, device: AnyDevice, whole: bool) -> None:
        if absent := lack(device, self._role(), whole):
            with contextlib.suppress(Exception):
                device.close()
            raise Nonconformity(absent)

    def _role(self) -> str:
        for role, kept in KEPT.items():
            if isinstance(self.config, kept.declared):
                return role
        raise Nonconformity(f"its configuration is {self.config!r}, where the table of a product is expected")

    @contextlib.contextmanager
    def started(self, next_seq: int = 0) -> Iterator[AnyDevice]:
        """A driver that runs, its samples numbered from ``next_seq``."""
        device = self.made()
        try:
            self.start(device, next_seq)
            yield device
        finally:
            device.close()

    @contextlib.contextmanager
    def failing(self, kind: str, value: bool | float) -> Iterator[None]:
        """The fault is there until the block ends."""
        self.fault(kind, value)
        try:
            yield
        finally:
            self.fault("unplug" if kind == "unplug" else "heal", kind != "unplug")

    def listen(self, device: AnyDevice, seconds: float) -> Heard:
        """Polls as the loop does; an axis is asked for a sample each turn, and a switch pressed now and then."""
        heard, end_ns = Heard([], []), self.now() + round(seconds * 1e9)
        act_ns = self.now()
        while (begun_ns := self.now()) < end_ns:
            if begun_ns >= act_ns:
                self.act()
                act_ns += ACT_NS
            if isinstance(self.config, AxisProduct):
                device.request(begun_ns)  # type: ignore[union-attr] # an axis is what has that
            heard.samples.extend(device.poll(begun_ns))
            heard.polls_ns.append(self.now() - begun_ns)
            self.wait(device, TURN_S)
        return heard

    def restarted(self, next_seq: int) -> AnyDevice:
        """A new driver that runs, tried again until ``BACK_S`` are over; raises Nonconformity."""
        end_ns, why = self.now() + round(BACK_S * 1e9), ""
        while self.now() < end_ns:
            device = self.open_or_say()
            if isinstance(device, str):
                why = device
                continue
            try:
                self.start(device, next_seq)
                return device
            except DeviceError as error:
                device.close()
                why = str(error)
        raise Nonconformity(f"it does not start again within {BACK_S:g} s of its return: {why}")

    def open_or_say(self) -> AnyDevice | str:
        """A new driver, or why there is none yet."""
        try:
            return self.made()
        except DeviceError as error:
            time.sleep(TURN_S)
            return str(error)
