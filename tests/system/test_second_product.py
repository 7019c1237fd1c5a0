"""The second force sensor does the whole job: one line of configuration changes, nothing else."""

import time
from pathlib import Path

import pytest

from mock_devices.testing.commands import EXAMPLES, Running, ServedBench, rig
from rig.recording.reader import read_recording
from rig.recording.sessions import open_session

pytestmark = pytest.mark.xdist_group("commands")
SURFACE_MM = 20.0


def test_one_line_exchanges_the_force_sensor(bench: ServedBench, tmp_path: Path) -> None:
    port = bench.endpoints.devices["force_modbus"]["serial"]
    settings = bench.settings("force.product=robotiq-ft300", f"force.port={port}")
    said = rig("capture", EXAMPLES / "quick.toml", "--out", tmp_path / "session", *settings, folder=tmp_path)
    assert said.code == 0, said.err
    recording = read_recording(tmp_path / "session" / "trial_001.mcap")
    assert "FT" in recording.metadata["devices"]["force"]
    force, loop = recording.tables["force"], recording.tables["loop"]
    cycles = int(loop["cycle"][-1] - loop["cycle"][0])
    assert cycles / len(force) == pytest.approx(10.0, rel=0.1)
    assert loop["surface_mm"][-1] == pytest.approx(SURFACE_MM, abs=0.25)
    assert float(recording.metadata["summary"]["peak_force_N"]) > 3.0


@pytest.mark.parametrize("product", ["bota-sensone", "robotiq-ft300"])
def test_8_mm_are_8_mm_with_either_sensor(bench: ServedBench, tmp_path: Path, product: str) -> None:
    """Depth is the bench's own: how far the true tip went below the true surface."""
    role = {"bota-sensone": "force", "robotiq-ft300": "force_modbus"}[product]
    settings = bench.settings(f"force.product={product}", f"force.port={bench.endpoints.devices[role]['serial']}")
    (tmp_path / "one.toml").write_text("speeds_mm_s = [10]\ntrials = 1\ndepth_mm = 8\n")
    running = Running(["capture", tmp_path / "one.toml", "--out", tmp_path / "session", *settings], tmp_path)
    deepest_mm = 0.0
    while running.process.poll() is None:
        deepest_mm = max(deepest_mm, bench.control.number("tip.depth_mm"))
        time.sleep(0.01)
    assert running.end().code in (0, 4)
    (trial, *_) = open_session(tmp_path / "session").trials
    assert trial.surface_low_mm - 0.05 <= SURFACE_MM <= trial.surface_high_mm + 0.05
    assert trial.surface_mm == pytest.approx(SURFACE_MM, abs=0.2)
    assert deepest_mm == pytest.approx(8.0, abs=0.2)
