"""Which ports the computer has and who answers there. USB is read from the system; nothing is written without consent.

An unknown port may be somebody else's pump or printer: what is sent to it is for a person to allow. The drivers
themselves ask who is there, and change nothing; one that has no question of its own is started, which moves nothing.
"""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from serial.tools import list_ports

from controller.devices.drivers import open_axis, open_force, open_tracker
from controller.inputs.runner import open_input
from drivers.can.socketcan import bitrate_of, shown_by_ip
from drivers.evdev.device import BY_NAME
from drivers.evdev.port import NAMES, key_devices
from drivers.lsl.library import streams_there
from drivers.roles import Device, Identifying, Identity
from rig.config.products.evdev_switch import EvdevSwitch
from rig.config.products.inputs import INPUTS
from rig.config.products.lsl_stream import LslStream
from rig.config.products.registry import AXES, FORCE_SENSORS, TRACKERS, name_of
from rig.config.products.roles import AxisProduct, Product
from rig.config.wiring import Limits, Wiring
from rig.config.words import toml
from rig.errors import RigError
from rig.plugins import declaring
from rig.results.devices import PortFound

# Vendor and product numbers of the USB ID repository (usb.ids) and of the makers' own documents: what an adapter is,
# not who is behind it.
ADAPTERS = {
    (0x0403, 0x6001): "FTDI serial adapter",
    (0x0403, 0x6010): "FTDI adapter of two lines",
    (0x0403, 0x6015): "FTDI serial adapter",
    (0x0403, 0xFFA8): "Lawicel CANUSB, CAN by SLCAN",
    (0x067B, 0x2303): "Prolific serial adapter",
    (0x0C72, 0x000C): "PEAK PCAN-USB",
    (0x10C4, 0xEA60): "Silicon Labs serial adapter",
    (0x16D0, 0x117E): "CANable, CAN by SLCAN",
    (0x1A86, 0x7523): "CH340 serial adapter",
    (0x1D50, 0x606F): "CAN adapter of the gs_usb kind",
    (0x2341, 0x0043): "Arduino Uno",
    (0xAD50, 0x60C4): "CANable, CAN by SLCAN",
}
# Those without a serial line, which python-can drives itself: its interface, and how it calls the first of them.
DRIVEN = {(0x0C72, 0x000C): ("pcan", "PCAN_USBBUS{}", 1), (0x1D50, 0x606F): ("gs_usb", "{}", 0)}
ARPHRD_CAN = "280"  # linux/if_arp.h
SYSTEM = Path("/sys")
BY_ID = Path("/dev/serial/by-id")
ASKED_Hz = 100.0
Consent = Callable[[PortFound], bool]


class AtPort(NamedTuple):
    """A product that may be at a port."""

    role: str
    product: type[Product]


def candidates(usb: str = "") -> list[AtPort]:
    """Products that may stand at a serial line whose adapter is ``usb``: those that only listen for a moment first.

    An adapter that some of ours are known by is theirs, and that of plug-ins, who have none named. Behind one that
    belongs to nobody, what has adapters of its own comes last.
    """
    every = list(_at_lines())
    fit = [one for one in every if usb[:9] in one.product.usb]
    if fit:
        return fit + [
            one for one in every if one not in fit and declaring(f"tissue_rig.{one.role}", name_of(one.product))
        ]
    return sorted(every, key=lambda one: bool(usb and one.product.usb))


def _at_lines() -> Iterator[AtPort]:
    roles: tuple[tuple[str, Iterable[type[Product]]], ...] = (
        ("force", FORCE_SENSORS.values()), ("axis", AXES.values()), ("tracker", TRACKERS.values()),
        ("input", (product for product in INPUTS.values() if product.at_line)),
    )  # fmt: skip
    yield from (AtPort(role, product) for role, products in roles for product in products)


def ports() -> list[PortFound]:
    """Serial ports of this computer as USB describes them, under their lasting names; nothing is opened."""
    return [
        PortFound(
            address=_lasting(port.device), usb=_usb(port), kind=ADAPTERS.get((port.vid, port.pid), ""), asked=False
        )
        for port in sorted(list_ports.comports())
        if port.vid is not None
    ]


def switches(names: Path = NAMES) -> list[PortFound]:
    """Input devices of Linux by their names; nothing is opened, and which of them is a foot switch a person knows."""
    return [_listed(EvdevSwitch, f"{BY_NAME}{name}", "keys, as of a foot switch") for name in key_devices(names)]


def buses(system: Path = SYSTEM, show: Callable[[str], str] = shown_by_ip) -> list[PortFound]:
    """CAN buses of Linux, and adapters that Linux leaves to python-can; nothing is opened."""
    kinds = sorted(system.glob("class/net/*/type"))
    ours = [kind.parent.name for kind in kinds if kind.read_text().strip() == ARPHRD_CAN]
    found = [_bus("socketcan", name, bitrate=bitrate_of(name, show)) for name in ours]
    adapters = sorted(path.parent for path in system.glob("bus/usb/devices/*/idVendor"))
    for numbers, (interface, name, first) in DRIVEN.items():
        free = [path for path in adapters if _numbers(path) == numbers and not any(path.glob("*/net/*"))]
        found += [_bus(interface, name.format(first + place), numbers) for place in range(len(free))]
    return found


def _bus(interface: str, port: str, numbers: tuple[int, int] | None = None, bitrate: int = 0) -> PortFound:
    usb, kind = ("{:04x}:{:04x}".format(*numbers), ADAPTERS[numbers]) if numbers else ("", "CAN bus of Linux")
    rate = f"bitrate = {bitrate}\n" if bitrate else ""
    lines = f'[axis]\ninterface = "{interface}"\nport = {toml(port)}\n{rate}{_scale(Wiring().axis)}'
    return PortFound(address=port, usb=usb, kind=kind, asked=False, role="axis", lines=lines)


def _numbers(adapter: Path) -> tuple[int, int]:
    vendor, product = (int((adapter / name).read_text(), 16) for name in ("idVendor", "idProduct"))
    return vendor, product


def streams() -> list[PortFound]:
    """Streams of Lab Streaming Layer on this computer, which their programs announce; none without that extra."""
    found = streams_there() if find_spec("pylsl") else []
    return [_listed(LslStream, name, f"stream of kind {kind or 'unknown'}") for name, kind in found]


def _listed(product: type[Product], address: str, kind: str) -> PortFound:
    lines = lines_of("input", product, address)
    return PortFound(
        address=address, usb="", kind=kind, asked=False, role="input", product=name_of(product), lines=lines
    )


def lines_of(role: str, product: type[Product], address: str) -> str:
    """For `rig.toml`; of an input with a name that a person may change."""
    table = f"{role}.{product.mock.role if product.mock else 'one'}" if role == "input" else role
    return f'[{table}]\nproduct = "{name_of(product)}"\nport = {toml(address)}\n{_scale(product())}'


def _scale(config: Product) -> str:
    unstated = isinstance(config, AxisProduct) and config.scale_unstated
    return "# increments_per_mm = ...  (of your screw and gear)\n" if unstated else ""


def named(address: str) -> PortFound:
    """A port that a person names."""
    return PortFound(address=address, usb="", kind="named by you", asked=False)


def _usb(port: "list_ports.ListPortInfo") -> str:  # type: ignore[name-defined] # of pyserial's platforms
    texts = (port.manufacturer, port.product, port.serial_number)
    return " ".join([f"{port.vid:04x}:{port.pid:04x}", *(text for text in texts if text)])


def _lasting(device: str) -> str:
    """The link that names the adapter itself, whatever else is plugged in."""
    links = sorted(BY_ID.iterdir()) if BY_ID.is_dir() else []
    return next((str(link) for link in links if link.resolve() == Path(device).resolve()), device)


def find(seen: Iterable[PortFound], consent: Consent) -> Iterator[PortFound]:
    """Each port, asked who is there where ``consent`` says so; what is no line, or says what it is, is not."""
    for port in seen:
        yield ask(port) if not port.lines and consent(port) else port


def ask(port: PortFound) -> PortFound:
    """Lets each product's driver look for its device at ``port``, until one answers."""
    why = ""
    asked = candidates(port.usb)
    for role, product in asked:
        try:
            found = _identity(role, product, port.address)
        except RigError as error:
            why = str(error)
            continue
        said = {"role": role, "product": found.product, "device": f"{found.product}, firmware {found.firmware}"}
        lines = lines_of(role, product, port.address)
        more = {"product": name_of(product), "serial": found.serial, "asked": True, "lines": lines}
        return port.model_copy(update=said | more)
    nobody = f"no device of {len(asked)} products answers there; the last said: {why}"
    return port.model_copy(update={"asked": True, "problem": nobody})


def _identity(role: str, product: type[Product], address: str) -> Identity:
    device = _opened(role, product.model_validate({"port": address}))
    if isinstance(device, Identifying):
        return device.identify()
    with contextlib.closing(device):
        device.start()
        return device.identity


def _opened(role: str, config: Product) -> Device:
    openers: dict[str, Callable[[], Device]] = {
        "force": lambda: open_force(config),  # type: ignore[arg-type] # each role has its products
        "axis": lambda: open_axis(config, Limits(), ASKED_Hz),  # type: ignore[arg-type]
        "tracker": lambda: open_tracker(config),  # type: ignore[arg-type]
        "input": lambda: open_input(config),  # type: ignore[arg-type]
    }
    return openers[role]()
