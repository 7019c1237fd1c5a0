"""The second force sensor does the whole job: one line of configuration changes, nothing else."""

from pathlib import Path

import pytest

from rig.recording.reader import read_recording
from tests.system.stage import EXAMPLES, Stage, rig

pytestmark = pytest.mark.xdist_group("commands")
SURFACE_MM = 20.0


def test_one_line_exchanges_the_force_sensor(bench: Stage, tmp_path: Path) -> None:
    port = bench.endpoints["force_modbus"]["serial"]
    settings = bench.settings("force.product=robotiq-ft300", f"force.port={port}")
    said = rig("capture", EXAMPLES / "quick.toml", "--out", tmp_path / "session", *settings, folder=tmp_path)
    assert said.code == 0, said.err
    recording = read_recording(tmp_path / "session" / "trial_001.mcap")
    assert "FT" in recording.metadata["devices"]["force"]
    force, loop = recording.tables["force"], recording.tables["loop"]
    slots = int(loop["slot"][-1] - loop["slot"][0])
    assert slots / len(force) == pytest.approx(10.0, rel=0.1)
    assert loop["surface_mm"][-1] == pytest.approx(SURFACE_MM, abs=3.0)
    assert float(recording.metadata["summary"]["peak_force_N"]) > 3.0
