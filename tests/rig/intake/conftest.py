"""Folders to import: a good one of CSV files, and an empty one."""

from pathlib import Path

import pytest

from tests.rig.recording.measured import measured


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return measured(tmp_path / "measured")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    return tmp_path / "in"
