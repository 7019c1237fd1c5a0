"""Where the real recordings are. They stay outside the project: where their folder is absent, tests of them skip."""

import os
from pathlib import Path
from typing import NoReturn

import pytest

from tests.lacking import lacking

ROOT = Path(__file__).resolve().parents[1]


def folder() -> Path:
    """TISSUE_RIG_DATA, or shared/data beside the project."""
    return Path(os.environ.get("TISSUE_RIG_DATA") or ROOT.parent / "shared" / "data")


def recording(name: str) -> Path:
    """The file or folder ``name`` in the folder of real recordings."""
    path = folder() / name
    if not path.exists():
        absent(f"no recording {name}: set TISSUE_RIG_DATA to the folder that holds it")
    return path


def absent(what: str) -> NoReturn:
    """Skips with that sentence where there is no such folder and none was promised; else all of it has to be there."""
    if os.environ.get("TISSUE_RIG_DATA") or folder().exists():
        lacking(what)
    pytest.skip(what)
