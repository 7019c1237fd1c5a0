"""Tests of real recordings skip where the folder of these is absent."""

import os
from pathlib import Path
from typing import NoReturn

import pytest

from mock_devices.testing.real_data import folder
from tests.lacking import lacking


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
