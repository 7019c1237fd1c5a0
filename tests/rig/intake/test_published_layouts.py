"""Made-up numbers in the layouts of published sets come in by the mappings of these, as the csv module reads them."""

import csv
import gzip
import io
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from mock_devices.testing.commands import ROOT
from rig.config.table import load
from rig.intake.mapping import DataMapping
from rig.intake.session import import_folder

# Files, encoding, lines above the numbers, columns of force and position, and what turns them into pressing and in.
LAYOUTS = {
    "asmi": ("*/*.csv", "utf-8", 11, (2, 1), -1.0),
    "vhb4910": ("0d*.csv", "gb18030", 3, (2, 1), -1.0),
    "perineal_indentation": ("*.csv.gz", "utf-8", 1, (2, 3), 1.0),
}
FIELDS = (("force", "fz_N"), ("axis", "position_mm"))


@pytest.fixture(scope="module")
def forms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("forms")
    subprocess.run([sys.executable, ROOT / "examples" / "forms" / "make.py", place], check=True, timeout=60)
    return place


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_comes_in_by_its_set_s_own_mapping(forms: Path, tmp_path: Path, name: str) -> None:
    pattern, encoding, above, columns, sense = LAYOUTS[name]
    read = []
    for file in sorted((forms / name).glob(pattern)):
        data = gzip.decompress(file.read_bytes()) if file.suffix == ".gz" else file.read_bytes()
        read += list(csv.reader(io.StringIO(data.decode(encoding))))[above:]
    mapping = load(DataMapping, ROOT / "examples" / "mappings" / f"{name}.toml")
    session = import_folder(forms / name, mapping, tmp_path / "out", datetime(2026, 11, 30, tzinfo=UTC))
    strokes = [trial.name for trial in session.trials if not trial.name.startswith("relaxation")]
    assert len(strokes) == 3
    tables = [session.recording(stroke).tables for stroke in strokes]
    came = [np.concatenate([one[stream][field] for one in tables]) for stream, field in FIELDS]
    for column, values in zip(columns, came, strict=True):
        assert values == pytest.approx(sense * np.array([float(row[column]) for row in read]), abs=1e-6)
