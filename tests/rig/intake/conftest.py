"""A good folder of CSV files to import."""

from pathlib import Path

import pytest

from tests.rig.recording.measured import measured


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return measured(tmp_path / "measured")
