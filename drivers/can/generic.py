"""CAN by any adapter that python-can knows: a thread receives, a bounded queue and an eventfd hand over.

The adapters' own libraries have no descriptor to wait on, or one that does not say when frames are there; a thread
costs 0.1 ms and works with all of them.
"""

import contextlib
import select
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import can

from drivers.can.health import BusHealth, BusState
from drivers.can.slcan import CanFrame
from drivers.can.socketcan import FULL_LARGEST, ErrorFrame
from drivers.ports import PortClosed
from drivers.threaded_source import ThreadedSource
from rig.config.can_adapter import ADAPTERS, Option
from rig.errors import DeviceError

# A second of a full bus at 1 Mbit/s: whoever does not look for that long has lost them anyway.
QUEUE_LARGEST = 10_000
RECEIVE_S = 0.1  # how soon the thread notices that it is to end
# These hand back what this process sent itself, though they are told not to.
ECHOING = frozenset({"udp_multicast"})
ECHOES_LARGEST = 256
STATES = {
    can.BusState.ACTIVE: BusState.ACTIVE,
    can.BusState.PASSIVE: BusState.PASSIVE,
    can.BusState.ERROR: BusState.OFF,
}
# PCAN-Basic's BUSOFF, BUSPASSIVE and BUSHEAVY, at which its counters are those of a warning.
PEAK_STATES = {0x10: BusState.OFF, 0x40000: BusState.PASSIVE, 0x08: BusState.WARNING}
# PEAK's library says by an error of reading that its controller went passive; the thread is not to spin by that.
AGAIN_S = 0.001


def _by_state(bus: can.BusABC, _: can.Message | None, __: BusState) -> BusState:
    """What python-can says, which for many adapters is ACTIVE whatever happens."""
    return STATES.get(bus.state, BusState.ACTIVE)


def _by_status(bus: Any, _: can.Message | None, __: BusState) -> BusState:
    """PEAK's own word: `state` of python-can is what was asked for."""
    status = bus.status()
    return next((state for bit, state in PEAK_STATES.items() if status & bit), BusState.ACTIVE)


def _by_error_frames(_: can.BusABC, message: can.Message | None, before: BusState) -> BusState:
    """gs_usb hands on the error frames of Linux."""
    if message is None or not message.is_error_frame:
        return before
    return ErrorFrame(message.arbitration_id, int.from_bytes(message.data[1:2])).state(before)


TOLD = {"pcan": _by_status, "gs_usb": _by_error_frames}


class PythonCanLink:
    """A bus of python-can that belongs to this process."""

    def __init__(
        self, bus: can.BusABC, name: str, bitrate: int, interface: str = "", now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self.decoder = self.health = BusHealth(bitrate)
        self._bus, self._name, self._now, self._told = bus, name, now, TOLD.get(interface, _by_state)
        self._own: deque[CanFrame] = deque(maxlen=ECHOES_LARGEST if interface in ECHOING else 0)
        self._closed, self._full = False, 0
        self._source = ThreadedSource[CanFrame](name, self._received, QUEUE_LARGEST, now=now)
        self._poller = select.poll()
        self._poller.register(self._source.fileno(), select.POLLIN)
        self._source.start()

    def fileno(self) -> int:
        """Turns readable when frames are there, or the adapter is gone."""
        return self._source.fileno()

    def read(self) -> list[CanFrame]:
        """Frames that have arrived, possibly none; raises PortClosed, also where the bus went off."""
        try:
            frames = [arrived.item for arrived in self._source.take()]
        except DeviceError as error:
            raise self._gone(str(error.__cause__ or error)) from error
        self.decoder.dropped = self._source.dropped
        self.decoder.frames += len(frames)
        self.decoder.passed(frames, self._now())
        return frames

    def wait(self, timeout_s: float) -> None:
        """Sleeps until something arrives or the time is over; for set-up only."""
        self._poller.poll(max(timeout_s, 0.0) * 1000)

    def send(self, *frames: CanFrame) -> None:
        """Hands over ``frames``; one that is not taken is counted, and raises PortClosed when that lasts."""
        for frame in frames:
            self._own.append(frame)
            try:
                self._bus.send(_message(frame), timeout=0)
                self._full = 0
            except can.CanOperationError as error:
                self.decoder.refused += 1
                self._full += 1
                if self._full >= FULL_LARGEST:
                    raise self._gone(f"it takes no more frames: {error}") from error
            except (can.CanError, OSError) as error:
                raise self._gone(str(error)) from error
        self.decoder.passed(frames, self._now())

    def close(self) -> None:
        """Ends the thread and gives the adapter back; may be called twice and never raises."""
        if not self._closed:
            self._closed = True
            self._source.close()
            with contextlib.suppress(Exception):
                self._bus.shutdown()

    def _received(self) -> list[CanFrame]:
        """In the thread: the next frame, if one comes soon; raises where the bus went off or the adapter is gone."""
        message = self._next()
        self.decoder.state = self._told(self._bus, message, self.decoder.state)
        if self.decoder.state is BusState.OFF:
            raise DeviceError("its controller went off the bus after too many errors")
        if message is None or not message.is_rx:  # gs_usb hands back what was sent
            return []
        if message.is_error_frame:
            self.decoder.error_frames += 1
            return []
        frame = _frame(message)
        if frame in self._own:
            self._own.remove(frame)
            return []
        return [frame]

    def _next(self) -> can.Message | None:
        try:
            return self._bus.recv(RECEIVE_S)
        except can.CanOperationError:
            if self._told(self._bus, None, self.decoder.state) < BusState.PASSIVE:
                raise
            time.sleep(AGAIN_S)
            return None

    def _gone(self, why: str) -> PortClosed:
        return PortClosed(
            f"{self._name}: the CAN bus is gone ({why}); check adapter, bit rate, terminators, cable and power"
        )


def _message(frame: CanFrame) -> can.Message:
    return can.Message(
        arbitration_id=frame.can_id, data=frame.data, dlc=len(frame.data), is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
    )  # fmt: skip


def _frame(message: can.Message) -> CanFrame:
    remote = message.is_remote_frame
    data = bytes(message.dlc) if remote else bytes(message.data)
    return CanFrame(message.arbitration_id, data, message.is_extended_id, remote)


def open_bus(interface: str, port: str, bitrate: int, options: Mapping[str, Option]) -> can.BusABC:
    """The adapter, opened by python-can; raises DeviceError in one sentence."""
    channel: int | str = int(port) if port.isdecimal() else port
    by_number = interface == "gs_usb" and not options.keys() & {"bus", "address"}
    extra: dict[str, Any] = {**({"index": channel} if by_number else {}), **options}
    try:
        return can.Bus(interface=interface, channel=channel, bitrate=bitrate, ignore_config=True, **extra)
    except Exception as error:  # an adapter whose library is absent raises whatever its module runs into
        adapter = ADAPTERS[interface]
        raise DeviceError(
            f"{interface} {port}: python-can cannot open the adapter: {str(error) or type(error).__name__}; check that "
            f"it is plugged in, its maker's library is installed, and axis.port is {adapter.port} ({adapter.example})"
        ) from error
