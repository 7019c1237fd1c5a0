"""pyigtl, unchanged, against our mock; our driver against pyigtl's server, and against our mock in tracking data."""

import time
from collections.abc import Callable

import numpy as np
import pyigtl
import pytest
from scipy.spatial.transform import Rotation

from drivers.openigtlink.device import OpenIgtLinkTracker, open_tracker
from mock_devices.openigtlink.mock import OpenIgtLinkMock
from mock_devices.testing.ndi import ARM, TIP, StillPlant
from mock_devices.testing.played import played
from mock_devices.wire import TcpWire
from rig.channels import MarkerSample
from rig.config.products.openigtlink import OpenIgtLinkWiring
from rig.errors import DeviceError

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("clients")]
PATIENCE_S = 10.0


def mock_server() -> OpenIgtLinkMock:
    offset_ns = time.time_ns() - time.monotonic_ns()
    return OpenIgtLinkMock(TcpWire(), StillPlant(), ("tip", "arm"), lambda now_ns: now_ns + offset_ns)


def tracker_at(address: str, **settings: object) -> OpenIgtLinkTracker:
    return open_tracker(OpenIgtLinkWiring.model_validate({"port": f"tcp://{address}", **settings}))


def collected(tracker: OpenIgtLinkTracker, enough: Callable[[list[MarkerSample]], bool]) -> list[MarkerSample]:
    samples: list[MarkerSample] = []
    deadline_s = time.monotonic() + PATIENCE_S
    while not enough(samples):
        assert time.monotonic() < deadline_s, samples
        samples += tracker.poll(time.monotonic_ns())
        time.sleep(0.001)
    return samples


def test_pyigtl_reads_both_tools_of_the_mock() -> None:
    mock = mock_server()
    with played(mock):
        host, port = mock.endpoints()["tcp"].split(":")
        client = pyigtl.OpenIGTLinkClient(host, int(port))
        try:
            tip, arm = (client.wait_for_message(tool, timeout=PATIENCE_S) for tool in ("tip", "arm"))
        finally:
            client.stop()
            client.socket.close()
    assert tip.matrix[:3, 3] == pytest.approx(TIP[:3])
    assert arm.matrix[:3, 3] == pytest.approx(ARM[:3])
    assert tip.matrix[:3, :3] == pytest.approx(Rotation.from_quat((*TIP[4:7], TIP[3])).as_matrix(), abs=1e-6)
    assert abs(tip.timestamp - time.time()) < PATIENCE_S


@pytest.mark.parametrize("header_version", [1, 2])
def test_our_driver_reads_the_server_of_pyigtl(header_version: int) -> None:
    server = pyigtl.OpenIGTLinkServer(port=0, local_server=True, start_now=False)
    server.start()
    tracker = tracker_at(f"127.0.0.1:{server.server_address[1]}")
    turn = np.eye(4)
    turn[:3, 3] = TIP[:3]

    def send() -> None:
        now_s = time.time()
        for tool in ("tip", "arm"):
            message = pyigtl.TransformMessage(turn, timestamp=now_s, device_name=tool)
            message.header_version = header_version
            server.send_message(message, wait=False)

    try:
        send()
        tracker.start()
        send()
        samples = collected(tracker, lambda samples: len(samples) >= 4)
    finally:
        tracker.close()
        server.stop()
    assert {(s.tool, s.x_mm, s.y_mm, s.z_mm, s.valid) for s in samples} == {(0, *TIP[:3], 1), (1, *TIP[:3], 1)}
    assert tracker.identity.firmware == f"header version {header_version}"


@pytest.mark.parametrize("stream", ["TRANSFORM", "TDATA"])
@pytest.mark.parametrize("version", [1, 2, 3])
def test_frames_come_at_their_rate_with_both_tools(stream: str, version: int) -> None:
    mock = mock_server()
    with played(mock):
        tracker = tracker_at(mock.endpoints()["tcp"], stream=stream, version=version, rate_Hz=50.0)
        tracker.start()
        samples = collected(tracker, lambda samples: len(samples) >= 60)
        tracker.close()
    assert {(s.tool, s.x_mm, s.y_mm, s.z_mm) for s in samples} == {(0, *TIP[:3]), (1, *ARM[:3])}
    assert all(sample.valid and sample.capture_ns <= sample.arrival_ns for sample in samples)
    spacing_ms = 20.0 if stream == "TDATA" else 1000 / 60
    taken_ns = [sample.capture_ns for sample in samples if sample.tool == 0]
    assert float(np.median(np.diff(taken_ns))) * 1e-6 == pytest.approx(spacing_ms, rel=0.1)


@pytest.mark.parametrize("stream", ["TRANSFORM", "TDATA"])
def test_a_hidden_tool_is_invalid_and_damage_is_counted(stream: str) -> None:
    mock = mock_server()
    with played(mock):
        tracker = tracker_at(mock.endpoints()["tcp"], stream=stream)
        tracker.start()
        mock.missing = {1}
        mock.corrupt_every = 7
        samples = collected(
            tracker, lambda samples: sum(not sample.valid for sample in samples) > 10 and samples[-1].tool == 1
        )
        tracker.close()
    assert {sample.valid for sample in samples[-2:]} == {0, 1}
    assert tracker.counters.checksum_errors > 0


def test_a_server_that_falls_silent_and_one_that_goes_are_lost() -> None:
    mock = mock_server()
    with played(mock):
        tracker = tracker_at(mock.endpoints()["tcp"])
        tracker.start()
        mock.silent = True
        with pytest.raises(DeviceError, match="no tool came for 1 s"):
            collected(tracker, lambda _: False)
    with pytest.raises(DeviceError, match=r"closed the connection|connection lost"):
        collected(tracker, lambda _: False)
    tracker.close()
