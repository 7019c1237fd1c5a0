"""Several nodes on one link: who opens a bus that is open already gets a view of it, and sees its own node's frames.

Frames of one node have its number in the lower seven bits of their identifier (CiA 301); SYNC and orders of the network
come from the host alone. Two nodes that answer SYNC both answer each SYNC that either of their drivers sends.
"""

import os
import select
import threading
from collections import deque
from collections.abc import Callable

from drivers.can.bus import CanLink
from drivers.can.health import BusHealth, Counted
from drivers.can.opening import CanNode, OpenLink, opener
from drivers.can.slcan import CanFrame

NODE_BITS = 0x7F
# A second of a full bus: a node whose driver does not look for that long is lost to it anyway.
HELD_LARGEST = 10_000
LOOK_AGAIN_S = 0.01  # how soon a node sees what another one's driver has read for it meanwhile


class SharedBus:
    """One open link and its views; closed with the last of them."""

    def __init__(self, link: CanLink) -> None:
        self.link = link
        self.views: list[NodeView] = []
        self.strange = 0
        self._lock = threading.RLock()

    def view(self, node: int) -> "NodeView":
        """A view of the frames of ``node``."""
        with self._lock:
            view = NodeView(self, node)
            self.views.append(view)
            return view

    def distribute(self) -> None:
        """Reads the link once and hands each frame to the view it is for; raises PortClosed."""
        with self._lock:
            for frame in self.link.read():
                self._hand_over(frame)

    def _hand_over(self, frame: CanFrame) -> None:
        wanted = [view for view in self.views if view.node == frame.can_id & NODE_BITS]
        for view in wanted:
            view.take(frame)
        self.strange += not wanted

    def send(self, *frames: CanFrame) -> None:
        """Hands over ``frames`` in one piece."""
        with self._lock:
            self.link.send(*frames)

    def leave(self, view: "NodeView") -> None:
        """One view fewer; the last one closes the link."""
        with self._lock:
            if view in self.views:
                self.views.remove(view)
                if not self.views:
                    self.link.close()

    @property
    def empty(self) -> bool:
        """Whether nobody uses it."""
        return not self.views


class NodeView:
    """The CanLink of one node on a bus that others use too."""

    def __init__(self, bus: SharedBus, node: int) -> None:
        self.node = node
        self.bus = bus
        self._held: deque[CanFrame] = deque(maxlen=HELD_LARGEST)
        self._readable = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._waiting = select.epoll()
        for descriptor in (self._readable, bus.link.fileno()):
            self._waiting.register(descriptor, select.EPOLLIN)
        self._closed = False

    @property
    def decoder(self) -> Counted:
        """Counts of the whole bus."""
        return self.bus.link.decoder

    @property
    def health(self) -> BusHealth:
        """Of the whole bus."""
        return self.bus.link.health

    def fileno(self) -> int:
        """Turns readable when frames may be there, whoever reads the bus first."""
        return self._waiting.fileno()

    def take(self, frame: CanFrame) -> None:
        """A frame of this node, found by whoever read the bus."""
        self._held.append(frame)
        os.eventfd_write(self._readable, 1)

    def read(self) -> list[CanFrame]:
        """Frames of this node that have arrived, possibly none; raises PortClosed."""
        self.bus.distribute()
        if not self._held:
            return []
        os.eventfd_read(self._readable)
        return [self._held.popleft() for _ in range(len(self._held))]

    def wait(self, timeout_s: float) -> None:
        """Sleeps until something arrives or the time is over; for set-up only."""
        if not self._held:
            self.bus.link.wait(min(timeout_s, LOOK_AGAIN_S))

    def send(self, *frames: CanFrame) -> None:
        """Hands over ``frames`` in one piece."""
        self.bus.send(*frames)

    def close(self) -> None:
        """Leaves the bus; may be called twice and never raises."""
        if not self._closed:
            self._closed = True
            self.bus.leave(self)
            self._waiting.close()
            os.close(self._readable)


class SharedBuses:
    """Buses that are open in this process, by port; a port is opened once, whoever asks for it."""

    def __init__(self) -> None:
        self.buses: dict[str, SharedBus] = {}
        self._lock = threading.Lock()

    def opener(self, node: int, open_link: OpenLink) -> OpenLink:
        """What gives ``node`` its view, opening the bus by ``open_link`` where nobody has."""

        def opened(port: str, bitrate: int, now: Callable[[], int]) -> CanLink:
            with self._lock:
                bus = self.buses.get(port)
                if bus is None or bus.empty:
                    bus = self.buses[port] = SharedBus(open_link(port, bitrate, now))
                return bus.view(node)

        return opened


BUSES = SharedBuses()


def view_of(config: CanNode) -> OpenLink:
    """What opens the bus of a device, or a view of it where another device of this process has opened it."""
    return BUSES.opener(config.node, opener(config))
