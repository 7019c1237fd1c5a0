"""The package `natnet`, unchanged, against the simulated Motive; our driver against it, over UDP in real time."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from natnet import DataDescriptions, DataFrame, NatNetClient

from drivers.optitrack.device import OptiTrackTracker, open_tracker
from mock_devices.optitrack.mock import OptiTrackMock
from mock_devices.testing.ndi import ARM, TIP, StillPlant
from mock_devices.testing.played import played
from mock_devices.udp_wire import UdpWire
from rig.channels import MarkerSample
from rig.config.products.optitrack_natnet import NatNetWiring
from rig.errors import DeviceError

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("clients")]
PATIENCE_S = 10.0


def motive(version: tuple[int, int] = (4, 1)) -> OptiTrackMock:
    return OptiTrackMock(UdpWire(), StillPlant(), time.monotonic_ns() - 1_000_000_000, ("tip", "arm"), version)


def waited(condition: Callable[[], object], act: Callable[[], object]) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s
        act()
        time.sleep(0.002)


def tracker_at(mock: OptiTrackMock, **settings: object) -> OptiTrackTracker:
    return open_tracker(NatNetWiring.model_validate({"port": f"udp://{mock.endpoints()['udp']}", **settings}))


def collected(tracker: OptiTrackTracker, count: int) -> list[MarkerSample]:
    samples: list[MarkerSample] = []
    waited(lambda: len(samples) >= count, lambda: samples.extend(tracker.poll(time.monotonic_ns())))
    return samples


@pytest.mark.parametrize("version", [(3, 1), (4, 0), (4, 1)])
def test_natnet_reads_bodies_markers_and_definitions_of_the_mock(version: tuple[int, int]) -> None:
    mock = motive(version)
    frames: list[DataFrame] = []
    descriptions: list[DataDescriptions] = []
    with played(mock):
        client = NatNetClient(command_port=int(mock.endpoints()["udp"].split(":")[1]), use_multicast=False)
        client.on_data_frame_received_event.handlers.append(frames.append)
        client.on_data_description_received_event.handlers.append(descriptions.append)
        client.connect()
        client.request_modeldef()
        waited(lambda: len(frames) > 5 and descriptions, client.update_sync)
        client.shutdown()
    assert [(body.name, body.id_num) for body in descriptions[0].rigid_bodies] == [("tip", 1), ("arm", 2)]
    tip, arm = frames[-1].rigid_bodies
    assert np.array(tip.pos) * 1000 == pytest.approx(np.array(TIP[:3]))
    assert np.array(arm.pos) * 1000 == pytest.approx(np.array(ARM[:3]))
    assert tip.rot == (TIP.qx, TIP.qy, TIP.qz, TIP.q0) and tip.tracking_valid
    assert {(marker.model_id, marker.marker_id) for marker in frames[-1].labeled_markers} == {
        (body, corner) for body in (1, 2) for corner in (1, 2, 3)
    }
    numbers = [frame.prefix.frame_number for frame in frames]
    assert numbers == sorted(set(numbers))


@pytest.mark.parametrize("version", [(3, 1), (4, 1)])
def test_our_driver_gets_frames_at_their_rate(version: tuple[int, int]) -> None:
    mock = motive(version)
    with played(mock):
        tracker = tracker_at(mock)
        tracker.start()
        samples = collected(tracker, 240)
        tracker.close()
    places = {(sample.tool, round(sample.x_mm, 3), round(sample.z_mm, 2)) for sample in samples}
    assert places == {(0, TIP.x_mm, TIP.z_mm), (1, ARM.x_mm, ARM.z_mm)}
    assert all(sample.valid and sample.capture_ns <= sample.arrival_ns for sample in samples)
    taken_ns = [sample.capture_ns for sample in samples if sample.tool == 0]
    assert float(np.median(np.diff(taken_ns))) * 1e-6 == pytest.approx(1000 / 120, rel=0.1)


def test_what_is_hidden_cut_or_silent_is_told() -> None:
    mock = motive()
    with played(mock):
        tracker = tracker_at(mock)
        tracker.start()
        mock.missing, mock.corrupt_every = {1}, 5
        collected(tracker, 20)
        last = collected(tracker, 20)[-2:]
        assert [(sample.tool, sample.valid) for sample in last] == [(0, 1), (1, 0)]
        waited(lambda: tracker.counters.checksum_errors, lambda: tracker.poll(time.monotonic_ns()))
        mock.silent = True
        with pytest.raises(DeviceError, match="no frame for 1 s"):
            collected(tracker, 10_000)
        tracker.close()


def test_nobody_is_sent_frames_who_is_gone() -> None:
    mock = motive()
    with played(mock):
        tracker = tracker_at(mock)
        tracker.start()
        tracker.close()
        mock._heard_ns -= 11_000_000_000
        waited(lambda: mock.due_ns > time.monotonic_ns() + 1_000_000_000, lambda: None)
