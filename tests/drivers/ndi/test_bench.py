"""The session with the mock in another process, in real time, over both kinds of wire."""

import select
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from drivers.ndi.device import NdiTracker
from drivers.ports import PortClosed, open_port
from mock_devices.testing.ndi import ARM, TIP, remote_tracker
from mock_devices.testing.remote import RemoteMock
from rig.channels import MarkerSample
from rig.config.products.ndi_polaris import PolarisWiring
from rig.errors import DeviceError

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("wire")]


@pytest.fixture(params=["serial", "tcp"])
def mock(request: pytest.FixtureRequest) -> Iterator[RemoteMock]:
    with remote_tracker(request.param) as mock:
        yield mock


@pytest.fixture
def start(mock: RemoteMock) -> Iterator[Callable[..., NdiTracker]]:
    devices: list[NdiTracker] = []

    def _start(**settings: Any) -> NdiTracker:
        device = NdiTracker(partial(open_port, mock.address), PolarisWiring(port=mock.address, **settings))
        devices.append(device)
        device.start()
        return device

    yield _start
    for device in devices:
        device.close()


def collect(device: NdiTracker, count: int, timeout_s: float = 10.0) -> list[MarkerSample]:
    """Polls as the loop does until there are ``count`` samples."""
    samples: list[MarkerSample] = []
    deadline = time.monotonic() + timeout_s
    while len(samples) < count and time.monotonic() < deadline:
        select.select([device.fileno()], [], [], 0.001)
        samples += device.poll(time.monotonic_ns())
    assert len(samples) >= count
    return samples


@pytest.mark.parametrize("reply", ["BX", "TX"])
def test_frames_come_with_both_tools(start: Callable[..., NdiTracker], reply: str) -> None:
    device = start(reply=reply)
    collect(device, 4)
    samples = collect(device, 40)
    assert {(s.tool, s.x_mm, s.y_mm, s.z_mm) for s in samples} == {(0, *TIP[:3]), (1, *ARM[:3])}
    assert all(sample.valid for sample in samples)
    assert all(sample.capture_ns <= sample.arrival_ns for sample in samples)
    frames = [sample.frame for sample in samples if sample.tool == 0]
    assert frames == sorted(set(frames))
    assert device.counters.checksum_errors == 0


def test_a_missing_tool_is_invalid(start: Callable[..., NdiTracker], mock: RemoteMock) -> None:
    device = start()
    collect(device, 4)
    mock.fault("missing", [1])
    collect(device, 4)
    assert {(sample.tool, sample.valid) for sample in collect(device, 10)} == {(0, 1), (1, 0)}


def test_a_tracker_silent_after_start_is_lost(start: Callable[..., NdiTracker], mock: RemoteMock) -> None:
    device = start()
    collect(device, 4)
    mock.fault("silent")
    with pytest.raises(DeviceError, match="gave no good reply to BX for 1 s"):
        collect(device, 1000)


def test_a_cut_cable_is_told(start: Callable[..., NdiTracker], mock: RemoteMock) -> None:
    device = start()
    collect(device, 4)
    mock.fault("cut")
    with pytest.raises(PortClosed, match=r"the line is gone|the other end closed|connection lost"):
        collect(device, 1000)


def test_an_error_reply_is_told(start: Callable[..., NdiTracker], mock: RemoteMock) -> None:
    device = start()
    collect(device, 4)
    mock.fault("error_reply", 0x0C)
    with pytest.raises(DeviceError, match="ERROR0C: command not allowed in the present mode"):
        collect(device, 1000)


def test_damaged_replies_are_counted_and_survived(start: Callable[..., NdiTracker], mock: RemoteMock) -> None:
    device = start()
    mock.fault("corrupt_every", 7)
    collect(device, 60)
    assert device.counters.checksum_errors > 0


def test_a_silent_tracker_does_not_start(start: Callable[..., NdiTracker], mock: RemoteMock) -> None:
    mock.fault("silent")
    with pytest.raises(DeviceError, match="INIT brought no reply; check power, cable"):
        start()


def test_it_starts_again_after_close(start: Callable[..., NdiTracker]) -> None:
    start().close()
    collect(start(), 4)
