"""Where the real recordings are; they stay outside the project."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def folder() -> Path:
    """TISSUE_RIG_DATA, or shared/data beside the project."""
    return Path(os.environ.get("TISSUE_RIG_DATA") or ROOT.parent / "shared" / "data")
