"""No two samples of a stream are recorded with one capture time, however they came."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from drivers.bota.codec import ForceFrame, encode_frame
from drivers.bota.device import BotaSensOne
from mock_devices.testing.clock import long_ago
from rig.channels import FORCE
from rig.config.products.bota_sensone import BotaWiring
from rig.recording.mcap_file import RecordingWriter
from rig.recording.reader import read_recording
from rig.recording.verify import verify
from tests.drivers.scripted_port import ScriptedPort

MS = 1_000_000
# Reads of a host that stalls: when, and how many frames have come since the one before.
READS = [(20, 1), (20.01, 19), (21, 1), (62, 41), (62.001, 1), (63, 0), (64, 2), (500, 100), (500.002, 30), (501, 1)]


def test_a_stalling_host_records_capture_times_that_all_differ_and_go_upwards(tmp_path: Path) -> None:
    port = ScriptedPort()
    sensor = BotaSensOne(port, BotaWiring(), long_ago)
    writer = RecordingWriter(tmp_path / "a.mcap", {})
    sent = 0
    for read_ms, frames in READS:
        for _ in range(frames):
            sent += 1
            port.push(encode_frame(ForceFrame(0, 0, 0, sent, 0, 0, 0, sent * 996, 25.0)))
        for sample in sensor.poll(round(read_ms * MS)):
            writer.add(FORCE.id, FORCE.pack(sample))
    writer.finish({"outcome": "done"})
    sensor.close()
    recorded = read_recording(tmp_path / "a.mcap").tables["force"]
    assert recorded["seq"].tolist() == list(range(sum(frames for _, frames in READS)))
    assert all(late > early for early, late in pairwise(recorded["capture_ns"].tolist()))
    assert np.all(recorded["capture_ns"] <= recorded["arrival_ns"])
    assert verify(tmp_path / "a.mcap").ok
