"""What the bench plays: a product on a wire, with the faults it can have. Makers in other distributions begin here."""

import math
import sys
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pkgutil import resolve_name
from typing import Any, TypeVar
from zlib import crc32

from mock_devices.faults.wires import WIRE_FAULTS, Fault, FaultKind, FaultyWire, faults_of
from mock_devices.interfaces import NEVER_NS, ProtocolMock
from mock_devices.parameters import Axis, Sensor
from rig import plugins
from rig.config.products.registry import ROLES, name_of
from rig.config.products.roles import MockPort, Product
from rig.deadline import within
from rig.errors import PluginError
from rig.plugins import Plugin, lacking

AnyMock = TypeVar("AnyMock", bound=ProtocolMock)
Answer = TypeVar("Answer")
ALL = "all"
# Six digits are what the Bota sensor prints.
OTHER_DEVICES = 900_000
# A mock's turn takes microseconds, and a bench that was stopped for a second gives up (`serve.GIVE_UP_NS`).
TURN_S = 2.0
# At one time: a stall of a second is made up for in as many at 1 kHz, each at a time of its own.
TURNS_LARGEST = 1000
TOLD = ("sampled", "serial_number", "latency_ms")
# What the bench can play in each role: one product, or all of them at once.
CHOICES: dict[str, dict[str, tuple[type[Product], ...]]] = {
    role: {
        ALL: tuple(product for product in products.values() if product.mock),
        **{name: (product,) for name, product in products.items() if product.mock},
    }
    for role, products in ROLES.items()
}


@dataclass(frozen=True)
class MockDevice:
    """One product on one wire; ``role`` is where its endpoint stands among the bench's, ``whose`` a plug-in's."""

    role: str
    mock: ProtocolMock
    wire: FaultyWire
    faults: dict[str, Fault]
    whose: Plugin | None = None

    @cached_property
    def player(self) -> "ProtocolMock | Contained":
        """What acts for it on the bench."""
        return Contained(self, self.whose) if self.whose else self.mock


class Contained:
    """A plug-in's mock, as the bench plays it: what it raises is said once, and from then on its device is silent."""

    def __init__(self, device: MockDevice, whose: Plugin) -> None:
        self._device, self._mock, self._whose, self._silent = device, device.mock, whose, False
        self._last_ns, self._turns = -1, 0

    @property
    def due_ns(self) -> int:
        return self._asked(lambda: math.ceil(min(self._mock.due_ns, NEVER_NS)), NEVER_NS)

    def filenos(self) -> list[int]:
        return self._asked(lambda: list(self._mock.filenos()), [])

    def tick(self, now_ns: int) -> None:
        self._last_ns, self._turns = now_ns, self._turns + 1 if now_ns == self._last_ns else 0
        self._asked(lambda: self._turn(now_ns), None)

    def _turn(self, now_ns: int) -> None:
        if self._turns > TURNS_LARGEST:
            raise TimeoutError(f"due_ns stays at {now_ns} whatever it has done")
        self._mock.tick(now_ns)

    def receive(self, now_ns: int) -> None:
        self._asked(lambda: self._mock.receive(now_ns), None)

    def close(self) -> None:
        self._asked(self._mock.close, None)
        self._device.wire.close()

    def _asked(self, ask: Callable[[], Answer], unsaid: Answer) -> Answer:
        if self._silent:
            return unsaid
        try:
            with within(TURN_S):
                return ask()
        except (Exception, SystemExit) as error:  # whatever it is, the other devices of the bench go on
            self._silent = self._device.wire.frozen = True
            what = " ".join(f"{type(error).__name__}: {error}".split())
            said = f"its mock at {self._device.role} is silent from now on, as a lost device, for it raised {what}"
            sys.stderr.write(f"bench: {replace(self._whose, error=said).sentence}; see its maker\n")
            return unsaid


def number_of(device: Sensor | Axis, usual: Sensor | Axis, number: int) -> int:
    """A device made of other figures is another device, and has another serial number."""
    return number if device == usual else number + 1 + crc32(device.model_dump_json().encode()) % OTHER_DEVICES


def served(
    role: str,
    mock: AnyMock,
    wire: FaultyWire,
    kinds: Mapping[str, FaultKind[AnyMock]],
    inside: Mapping[str, Fault] | None = None,
) -> MockDevice:
    """A device with its faults: those of the wire, of ``kinds``, and of what is ``inside``."""
    return MockDevice(role, mock, wire, faults_of(wire, WIRE_FAULTS) | faults_of(mock, kinds) | dict(inside or {}))


def made(products: Iterable[type[Product]], factory: object, spare: Container[type[Product]] = ()) -> list[MockDevice]:
    """What plays ``products``, by makers that are given ``factory``; raises PluginError where a plug-in's cannot.

    One that is ``spare`` is then left out, which is said.
    """
    return [device for product in products for device in _made(product, factory, product in spare)]


def _made(product: type[Product], factory: object, spare: bool) -> list[MockDevice]:
    if product.mock is None:
        return []
    declared = (name_of(product), product.__module__.partition(".")[0])
    used = (one for group in plugins.met().values() for one in group if not one.error)
    whose = next((one for one in used if (one.declares, one.module) == declared), None)
    try:
        devices = list(resolve_name(product.mock.maker)(factory))
        wrong = _trouble(product.mock, devices) if whose else ""
    except (Exception, SystemExit) as error:
        if whose is None:
            raise
        wrong = f"{type(error).__name__}: {error}"
    if whose and wrong:
        failed = PluginError(replace(whose, error=f"its mock cannot be played: {wrong}").sentence)
        if not spare:
            raise failed
        sys.stderr.write(f"bench: {failed}\n")
        return []
    return [replace(device, whose=whose) for device in devices] if whose else devices


def _trouble(port: MockPort, devices: list[Any]) -> str:
    for device in devices:
        if not isinstance(device, MockDevice):
            return f"its maker gives {device!r}, where a MockDevice is expected"
        if absent := lacking(device.mock, ProtocolMock):
            return f"it has no {', no '.join(absent)}"
        for told in TOLD:  # what a bench says of it, and a property may raise
            getattr(device.mock, told, None)
    served = any(device.role == port.role and port.kind in device.mock.endpoints() for device in devices)
    return "" if served else f"nothing of it is at {port.role} {port.kind}, where its declaration says it is"
