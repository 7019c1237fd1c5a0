"""The Chromium that is there, started as a test machine needs it."""

import shutil

import pytest
from playwright.sync_api import Browser, Playwright

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def installed() -> str | None:
    """Path of the browser, if there is one."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def find() -> str:
    """Path of the browser; skips the test, saying so, where there is none."""
    found = installed()
    if found is None:
        pytest.skip(f"no browser here: looked for {', '.join(NAMES)}")
    return found


def launch(playwright: Playwright, executable: str) -> Browser:
    """A headless browser."""
    return playwright.chromium.launch(executable_path=executable, args=list(ARGUMENTS))
