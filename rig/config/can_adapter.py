"""How a CAN bus is reached: the kinds of adapter, and the options that each of them takes of its own."""

from collections.abc import Mapping
from typing import Literal, NamedTuple, get_args

CanInterface = Literal["slcan", "socketcan", "pcan", "kvaser", "ixxat", "gs_usb", "udp_multicast"]
Option = bool | int | str
INTERFACES: tuple[CanInterface, ...] = get_args(CanInterface)


class Adapter(NamedTuple):
    """One kind of adapter: what `axis.port` names, an example of it, and its own options with their types."""

    port: str
    example: str
    options: Mapping[str, type]


ADAPTERS: Mapping[str, Adapter] = {
    "slcan": Adapter("the serial line of the adapter", "/dev/ttyACM0", {}),
    "socketcan": Adapter("the network interface, set up and running", "can0", {}),
    "pcan": Adapter("PEAK's name of the channel", "PCAN_USBBUS1", {"device_id": int, "auto_reset": bool}),
    "kvaser": Adapter("the number of the channel", "0", {"accept_virtual": bool, "single_handle": bool}),
    "ixxat": Adapter("the number of the channel", "0", {"unique_hardware_id": str, "extended": bool}),
    "gs_usb": Adapter("the number of the adapter among those plugged in", "0", {"bus": int, "address": int}),
    "udp_multicast": Adapter(
        "the multicast group that stands for the bus", "239.74.163.2", {"port": int, "hop_limit": int}
    ),
}


def wrong_options(interface: str, options: Mapping[str, Option]) -> str:
    """What is wrong with the options of an adapter, in words; empty if nothing."""
    known = ADAPTERS[interface].options
    for name, value in options.items():
        if name not in known:
            listed = ", ".join(known) or "none"
            return f"adapter.{name}: an adapter of the kind {interface} takes no such option; it has: {listed}"
        if type(value) is not known[name]:
            return f"adapter.{name}: {value!r} is no {known[name].__name__}, as {interface} needs it"
    return ""


def wrong_port(interface: str, port: str, unnamed: str) -> str:
    """What is wrong with the name of the bus; ``unnamed`` is the name by which the simulated bench serves it."""
    if port == unnamed and interface != "slcan":
        adapter = ADAPTERS[interface]
        return f"port: name {adapter.port} for {interface}, for example {adapter.example}"
    if interface in ("kvaser", "ixxat", "gs_usb") and not port.isdecimal():
        return f"port: {port!r} is not {ADAPTERS[interface].port}; for example {ADAPTERS[interface].example}"
    return ""
