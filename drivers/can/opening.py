"""From configuration to an open CAN link: the two fast paths of our own, and python-can for every other adapter."""

from collections.abc import Callable
from typing import Protocol

from drivers.can.bus import CanLink, SlcanLink
from drivers.can.generic import PythonCanLink, open_bus
from drivers.can.socketcan import SocketCanLink, open_socket, refuse_other_rate, shown_by_ip
from rig.config.can_adapter import CanInterface, Option

OpenLink = Callable[[str, int, Callable[[], int]], CanLink]


class CanNode(Protocol):
    """What the configuration of a device says of its place on a bus."""

    interface: CanInterface
    node: int
    adapter: dict[str, Option]


def opener(config: CanNode, show: Callable[[str], str] = shown_by_ip) -> OpenLink:
    """What opens the bus that ``config`` names, given port, bit rate and clock; ``show`` as in `shown_by_ip`."""
    interface = config.interface

    def by_socket(port: str, bitrate: int, now: Callable[[], int]) -> CanLink:
        refuse_other_rate(port, bitrate, show)
        return SocketCanLink(open_socket(port), port, bitrate, now)

    def by_library(port: str, bitrate: int, now: Callable[[], int]) -> CanLink:
        bus = open_bus(interface, port, bitrate, config.adapter)
        return PythonCanLink(bus, f"{interface} {port}", bitrate, interface, now)

    fast: dict[str, OpenLink] = {"slcan": SlcanLink, "socketcan": by_socket}
    return fast.get(interface, by_library)
