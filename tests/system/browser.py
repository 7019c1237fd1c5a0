"""The Chromium that is there, without which a test cannot run."""

from mock_devices.testing.browser import NAMES, installed
from tests.lacking import lacking


def find() -> str:
    """Path of the browser; without one the test cannot run."""
    found = installed()
    if found is None:
        lacking(f"no browser here: looked for {', '.join(NAMES)}")
    return found
