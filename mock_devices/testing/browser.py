"""The Chromium that is there, started as a test machine needs it."""

import shlex
import shutil
import tempfile
from pathlib import Path

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


# At a bench the browser is on another computer; on this one it must not take the processor from the simulated devices.
GIVES_WAY = 10


def launch(playwright: Playwright, executable: str, *more: str) -> Browser:
    """A headless browser that gives way to the bench: what starts here keeps the niceness that it is started with."""
    with tempfile.TemporaryDirectory() as folder:
        starter = Path(folder) / "browser"
        starter.write_text(f'#!/bin/sh\nexec nice -n {GIVES_WAY} {shlex.quote(executable)} "$@"\n')
        starter.chmod(0o755)
        return playwright.chromium.launch(executable_path=starter, args=[*ARGUMENTS, *more])
