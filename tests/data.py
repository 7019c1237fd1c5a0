"""Where the real recordings are. They stay outside the project: a test that needs one skips where it is absent."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def folder() -> Path:
    """TISSUE_RIG_DATA, or shared/data beside the project."""
    return Path(os.environ.get("TISSUE_RIG_DATA") or ROOT.parent / "shared" / "data")


def recording(name: str) -> Path:
    """The file or folder ``name`` in the folder of real recordings; skips without it."""
    path = folder() / name
    if not path.exists():
        pytest.skip(f"no recording {name}: set TISSUE_RIG_DATA to the folder that holds it")
    return path
