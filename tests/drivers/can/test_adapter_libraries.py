"""What python-can's own classes for PEAK and gs_usb tell, on stand-ins for their makers' libraries."""

import os
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from can.interfaces.pcan import basic

from drivers.can.generic import PythonCanLink, open_bus
from drivers.can.health import BusState
from drivers.can.slcan import CanFrame
from drivers.ports import PortClosed
from rig.config.can_adapter import Option
from rig.errors import DeviceError

PATIENCE_S = 5.0
Open = Callable[..., PythonCanLink]


class Peak:
    """PCAN-Basic: ``says`` are answers of its reading to come, ``now`` the state of the channel."""

    def __init__(self) -> None:
        self.says, self.now = deque[int](), int(basic.PCAN_ERROR_OK)
        self._event = os.eventfd(0)

    def become(self, state: int) -> None:
        """The controller changes, which its library tells once by an error of reading."""
        self.now = state
        self.says.append(state)
        os.eventfd_write(self._event, 1)

    def Read(self, _: object) -> tuple[int, None, None]:
        return (self.says.popleft() if self.says else basic.PCAN_ERROR_QRCVEMPTY), None, None

    def GetStatus(self, _: object) -> int:
        return self.now

    def GetValue(self, _: object, what: object) -> tuple[int, object]:
        return basic.PCAN_ERROR_OK, b"4.8.0.1" if what == basic.PCAN_API_VERSION else self._event

    def GetErrorText(self, error: int, _: int) -> tuple[int, bytes]:
        return basic.PCAN_ERROR_OK, b"%x" % error

    def SetValue(self, *_: object) -> int:
        return int(basic.PCAN_ERROR_OK)

    Initialize = Uninitialize = SetValue


class GsUsbFrame(SimpleNamespace):
    """As the package of that name has it."""

    def __init__(self, **given: Any) -> None:
        super().__init__(
            **{"can_id": 0, "can_dlc": 8, "data": [0] * 8, "echo_id": 0xFFFFFFFF, "timestamp": 0.0} | given
        )

    arbitration_id = property(lambda self: self.can_id & 0x1FFFFFFF)
    is_extended_id = property(lambda self: bool(self.can_id & 0x80000000))
    is_remote_frame = property(lambda self: bool(self.can_id & 0x40000000))
    is_error_frame = property(lambda self: bool(self.can_id & 0x20000000))


class GsUsb:
    """The one adapter that is plugged in, on bus 1 at address 4; ``heard`` is what comes from its bus."""

    heard: deque[GsUsbFrame]
    device_capability = SimpleNamespace(fclk_can=48_000_000)

    @classmethod
    def scan(cls) -> list["GsUsb"]:
        return [cls()]

    @classmethod
    def find(cls, bus: int | None = None, address: int | None = None) -> "GsUsb | None":
        return cls() if bus in (None, 1) and address in (None, 4) else None

    def read(self, frame: GsUsbFrame, timeout_ms: int) -> bool:
        if not self.heard:
            time.sleep(0.001)
            return False
        vars(frame).update(vars(self.heard.popleft()))
        return True

    def send(self, _: GsUsbFrame) -> None: ...

    def stop(self) -> None: ...

    start = stop

    def set_timing(self, **_: int) -> None: ...

    def set_bitrate(self, _: int) -> None: ...


@pytest.fixture
def opened() -> Iterator[Open]:
    links: list[PythonCanLink] = []

    def made(interface: str, port: str, options: Mapping[str, Option] | None = None) -> PythonCanLink:
        bus = open_bus(interface, port, 1_000_000, options or {})
        links.append(PythonCanLink(bus, f"{interface} {port}", 1_000_000, interface))
        return links[-1]

    yield made
    for link in links:
        link.close()


@pytest.fixture
def peak(monkeypatch: pytest.MonkeyPatch) -> Peak:
    peak = Peak()
    monkeypatch.setattr("can.interfaces.pcan.pcan.PCANBasic", lambda: peak)
    return peak


@pytest.fixture
def gs_usb(monkeypatch: pytest.MonkeyPatch) -> Iterator[deque[GsUsbFrame]]:
    """What its adapter hears."""
    flags = {"CAN_EFF_FLAG": 0x80000000, "CAN_RTR_FLAG": 0x40000000, "CAN_ERR_FLAG": 0x20000000, "CAN_MAX_DLC": 8}
    frames = {"GS_USB_NONE_ECHO_ID": 0xFFFFFFFF, "GsUsbFrame": GsUsbFrame}
    modules: dict[str, dict[str, Any]] = {
        "usb": {"core": SimpleNamespace(USBError=OSError)},
        "gs_usb": {},
        "gs_usb.constants": flags,
        "gs_usb.gs_usb": {"GsUsb": GsUsb},
        "gs_usb.gs_usb_frame": frames,
    }
    # As python-can's class may have met the real package, which is there in tests.
    monkeypatch.delitem(sys.modules, "can.interfaces.gs_usb", raising=False)
    for name, held in modules.items():
        module = ModuleType(name)
        vars(module).update(held)
        monkeypatch.setitem(sys.modules, name, module)
    GsUsb.heard = deque()
    yield GsUsb.heard
    sys.modules.pop("can.interfaces.gs_usb", None)


def until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.005)


def end_of(link: PythonCanLink) -> str:
    with pytest.raises(PortClosed) as told:
        until(lambda: bool(link.read()))
    return str(told.value)


def test_a_controller_of_peak_that_is_passive_is_told_and_carries_on(peak: Peak, opened: Open) -> None:
    link = opened("pcan", "PCAN_USBBUS1")
    for state, shown in (
        (basic.PCAN_ERROR_BUSPASSIVE, BusState.PASSIVE),
        (basic.PCAN_ERROR_BUSHEAVY, BusState.WARNING),
        (basic.PCAN_ERROR_BUSLIGHT, BusState.ACTIVE),
    ):
        peak.become(int(state))
        until(lambda shown=shown: link.health.state is shown)  # type: ignore[misc]
        assert link.read() == []
    peak.become(int(basic.PCAN_ERROR_BUSOFF))
    assert "its controller went off the bus" in end_of(link)


def test_an_adapter_of_peak_that_is_pulled_out_ends_the_link(peak: Peak, opened: Open) -> None:
    link = opened("pcan", "PCAN_USBBUS1")
    peak.become(int(basic.PCAN_ERROR_ILLHW))
    assert "pcan PCAN_USBBUS1: the CAN bus is gone" in end_of(link)


def test_error_frames_of_gs_usb_tell_the_controllers_state(gs_usb: deque[GsUsbFrame], opened: Open) -> None:
    """Classes and details of linux/can/error.h."""
    link = opened("gs_usb", "0")
    for detail, shown in ((0x08, BusState.WARNING), (0x20, BusState.PASSIVE), (0x40, BusState.ACTIVE)):
        gs_usb.append(GsUsbFrame(can_id=0x20000004, data=[0, detail, 0, 0, 0, 0, 0, 0]))
        until(lambda shown=shown: link.health.state is shown)  # type: ignore[misc]
    gs_usb.append(GsUsbFrame(can_id=0x20000080))
    until(lambda: link.health.error_frames == 4)
    assert link.health.state is BusState.ACTIVE
    gs_usb.append(GsUsbFrame(can_id=0x20000040))
    assert "its controller went off the bus" in end_of(link)


def test_what_gs_usb_hands_back_of_ours_is_nothing_heard(gs_usb: deque[GsUsbFrame], opened: Open) -> None:
    link = opened("gs_usb", "0")
    gs_usb.extend(
        (GsUsbFrame(can_id=0x80, can_dlc=0, echo_id=0), GsUsbFrame(can_id=0x701, can_dlc=1, data=[5] + [0] * 7))
    )
    heard: list[CanFrame] = []

    def listen() -> bool:
        heard.extend(link.read())
        return bool(heard)

    until(listen)
    assert heard == [CanFrame(0x701, b"\x05")]


@pytest.mark.usefixtures("gs_usb")
@pytest.mark.parametrize("options", [{}, {"bus": 1}, {"address": 4}, {"bus": 1, "address": 4}])
def test_an_adapter_of_gs_usb_is_named_by_number_or_by_its_place_on_usb(
    opened: Open, options: dict[str, Option]
) -> None:
    """python-can refuses both at once."""
    assert opened("gs_usb", "0", options).read() == []


@pytest.mark.usefixtures("gs_usb")
@pytest.mark.parametrize(("port", "options"), [("1", {}), ("0", {"bus": 2}), ("0", {"address": 5})])
def test_where_none_is_plugged_in_that_is_said(opened: Open, port: str, options: dict[str, Option]) -> None:
    with pytest.raises(DeviceError, match=f"^gs_usb {port}: python-can cannot open the adapter: Cannot find device"):
        opened("gs_usb", port, options)
