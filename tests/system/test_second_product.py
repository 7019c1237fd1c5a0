"""The second force sensor does the whole job: one line of configuration changes, nothing else."""

import time
from pathlib import Path

import pytest

from mock_devices.testing.commands import Running, ServedBench
from rig.recording.reader import read_recording
from rig.recording.sessions import open_session

pytestmark = [pytest.mark.extra, pytest.mark.xdist_group("commands")]
SURFACE_MM = 20.0


@pytest.mark.parametrize(
    ("product", "role", "model", "cycles_a_sample"),
    [
        pytest.param("bota-sensone", "force", "BFT-SENS", 1.0, marks=pytest.mark.by_hand),
        ("robotiq-ft300", "force_modbus", "FT", 10.0),
    ],
)
def test_8_mm_are_8_mm_with_either_sensor(
    bench: ServedBench, tmp_path: Path, product: str, role: str, model: str, cycles_a_sample: float
) -> None:
    """Depth is the bench's own: how far the true tip went below the true surface."""
    settings = bench.settings(f"force.product={product}", f"force.port={bench.endpoints.devices[role]['serial']}")
    (tmp_path / "one.toml").write_text("speeds_mm_s = [10]\ntrials = 1\ndepth_mm = 8\n")
    running = Running(["capture", tmp_path / "one.toml", "--out", tmp_path / "session", *settings], tmp_path)
    deepest_mm = 0.0
    while running.process.poll() is None:
        deepest_mm = max(deepest_mm, bench.control.number("tip.depth_mm"))
        time.sleep(0.01)
    assert running.end().code in (0, 4)
    (trial, *_) = open_session(tmp_path / "session").trials
    # One 95 % interval may miss; how many of many do is counted in tests/rig/trials/test_contact.py.
    assert trial.surface_low_mm < trial.surface_mm < trial.surface_high_mm < trial.surface_low_mm + 0.5
    assert trial.surface_mm == pytest.approx(SURFACE_MM, abs=0.2)
    assert deepest_mm == pytest.approx(8.0, abs=0.2)
    recording = read_recording(tmp_path / "session" / "trial_001.mcap")
    force, loop = recording.tables["force"], recording.tables["loop"]
    assert model in recording.metadata["devices"]["force"]
    assert int(loop["cycle"][-1] - loop["cycle"][0]) / len(force) == pytest.approx(cycles_a_sample, rel=0.1)
    assert loop["surface_mm"][-1] == pytest.approx(SURFACE_MM, abs=0.25)
    assert float(recording.metadata["summary"]["peak_force_N"]) > 3.0
