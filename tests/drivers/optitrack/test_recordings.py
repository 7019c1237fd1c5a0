"""Packets of a real Motive (NatNet 3), where they are at hand: ../shared/data/natnet, of python_natnet, BSD-3."""

import struct
from collections.abc import Iterator

import natnet
import numpy as np
import pytest
from natnet.data_frame import DataFrame
from natnet.packet_buffer import PacketBuffer

from drivers.optitrack import packets
from drivers.optitrack.device import OptiTrackTracker
from drivers.optitrack.frames import decode_frame
from drivers.optitrack.models import decode_models
from mock_devices.testing.clock import Clock
from rig.config.products.optitrack_natnet import NatNetWiring
from tests.data import recording
from tests.drivers.optitrack.scripted import ScriptedLink

VERSION = (3, 0)
UDP_PAYLOAD = 42  # behind Ethernet, IPv4 and UDP without options


def datagram_of(name: str) -> bytes:
    return (recording("natnet") / f"{name}_packet_v3.bin").read_bytes()


def packet(name: str) -> tuple[int, bytes]:
    return packets.split(datagram_of(name))


def traffic(message: int) -> Iterator[bytes]:
    """Datagrams of one kind in the captured traffic, in order; blocks of pcapng are read by hand."""
    text, at = (recording("natnet") / "traffic.pcapng").read_bytes(), 0
    while at < len(text):
        kind, length = struct.unpack_from("<II", text, at)
        if kind == 6:
            captured = struct.unpack_from("<I", text, at + 20)[0]
            datagram = text[at + 28 + UDP_PAYLOAD : at + 28 + captured]
            if struct.unpack_from("<H", datagram)[0] == message:
                yield datagram
        at += length


def test_the_server_says_who_it_is() -> None:
    message, payload = packet("serverinfo")
    server = packets.decode_server(payload)
    assert (message, server.name, server.natnet) == (packets.SERVER_INFO, "Motive", VERSION)
    assert server.ticks_Hz == 3_312_787  # as its bytes 93 8c 32 00 say: a processor's counter


def test_the_body_of_the_model_definition_has_its_number() -> None:
    assert decode_models(packet("modeldef")[1], VERSION) == {"RaceQuad": 2}


def test_a_frame_is_what_the_package_natnet_reads_of_it() -> None:
    payload = packet("mocapframe")[1]
    frame = decode_frame(payload, VERSION)
    theirs = DataFrame.read_from_buffer(PacketBuffer(payload), natnet.Version(3))
    (body,) = theirs.rigid_bodies
    assert frame.number == theirs.prefix.frame_number == 162734
    assert frame.bodies[2][:3] == pytest.approx([1000 * along for along in body.pos])
    x, y, z, w = body.rot
    assert frame.bodies[2][3:7] == (w, x, y, z)
    assert frame.ticks == theirs.suffix.stamp_camera_mid_exposure
    seen = {(one.model_id, one.marker_id): one.pos for one in theirs.labeled_markers if not one.occluded}
    assert frame.markers.keys() == seen.keys()
    for number, place in seen.items():
        assert frame.markers[number][:3] == pytest.approx([1000 * along for along in place])


def test_of_518_frames_none_is_lost_and_each_is_dated_by_the_cameras() -> None:
    frames = [decode_frame(packets.split(datagram)[1], VERSION) for datagram in traffic(packets.FRAME)]
    assert [frame.number for frame in frames] == list(range(162734, 163252))
    taken_s = np.array([frame.ticks for frame in frames]) / packets.decode_server(packet("serverinfo")[1]).ticks_Hz
    steps_s = np.diff(taken_s)
    assert float(np.median(steps_s)) == pytest.approx(1 / 120, rel=1e-4)
    assert steps_s.min() > 0 and steps_s.max() < 2 / 120


def test_the_captured_session_gives_518_samples_of_the_body_and_of_one_marker() -> None:
    clock, link = Clock(), ScriptedLink()
    link.answers = {
        packets.CONNECT: datagram_of("serverinfo"),
        packets.REQUEST_MODELS: datagram_of("modeldef"),
        packets.KEEP_ALIVE: datagram_of("mocapframe"),
    }
    config = NatNetWiring(port="udp://motive:1510", tools=("RaceQuad", "RaceQuad/2"))
    tracker = OptiTrackTracker(lambda: link, config, clock)
    tracker.start()
    link.answers.clear()
    samples = []
    for datagram in traffic(packets.FRAME):
        clock.advance(1 / 120)
        link.push(datagram)
        samples += tracker.poll(clock())
    tracker.close()
    assert [sample.frame for sample in samples if sample.tool == 0] == list(range(162734, 163252))
    assert len(samples) == 2 * 518 and tracker.counters.device_lost == 0
    assert all(sample.valid for sample in samples if sample.tool == 0)
    spacing_ns = np.diff([sample.capture_ns for sample in samples if sample.tool == 0])
    assert float(np.median(spacing_ns)) == pytest.approx(1e9 / 120, rel=0.005)
