"""The page beside OctoPrint's, both run here in one browser: `python -m benchmarks.octoprint`; last line JSON.

OctoPrint, of the version below, is installed from PyPI into a folder of its own and serves its own virtual printer,
whose temperatures are what it shows live; our service has the mock bench. Of each page: how long from its address to
the first live value, how long after the service hangs (SIGSTOP) and after it has ended (SIGKILL) the page says so, what
axe-core finds on the first view, how wide that is on a screen of 390 px, and what it loads from elsewhere. Ends with 1
where ours is worse in one of them.
"""

import argparse
import json
import math
import signal
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright
from playwright.sync_api import TimeoutError as TooLate

from hatch_build import LIMIT_S, SOURCES, fetch
from mock_devices.testing.browser import installed, launch
from mock_devices.testing.commands import free_port, served_bench, until
from mock_devices.testing.service import ServedRig

VERSION = "1.11.8"
# Nothing asks the internet, and whoever is on this computer is signed in: as a lab without a network has it.
SETTINGS = """
server: {firstRun: false, seenWizards: {corewizard: 4}, onlineCheck: {enabled: false},
  pluginBlacklist: {enabled: false}}
plugins: {virtual_printer: {enabled: true}, tracking: {enabled: false},
  _disabled: [announcements, softwareupdate, discovery, pluginmanager, backup, achievements]}
serial: {autoconnect: true, port: VIRTUAL, baudrate: 115200}
accessControl: {autologinLocal: true, autologinAs: ann}
"""
STARTS_S, SILENCE_S, SHOWN_S = 60.0, 60.0, 60.0
WIDE, NARROW = ViewportSize(width=1280, height=900), ViewportSize(width=390, height=900)
AXE = SOURCES / "node_modules" / "axe-core" / "axe.min.js"


@dataclass(frozen=True)
class Shown:
    """A page: where it is, whether it has a live number and says that its service is silent, and signals to that."""

    address: str
    live: str
    silent: str
    signal: Callable[[int], None]


@dataclass(frozen=True)
class Found:
    """Of one page; None where nothing was said for a minute."""

    first_value_s: float
    hang_told_s: float | None
    end_told_s: float | None
    violations: int
    width_at_390_px: int
    from_elsewhere: int


def found_of(browser: Browser, shown: Shown) -> Found:
    """Opens it as somebody does who has not been there before."""
    page = browser.new_context(viewport=WIDE).new_page()
    elsewhere = list[str]()
    here = ("http://127.0.0.1", "data:", "blob:")
    page.on("request", lambda sent: None if sent.url.startswith(here) else elsewhere.append(sent.url))
    started_s = time.monotonic()
    page.goto(shown.address)
    page.wait_for_function(shown.live, timeout=1e3 * SHOWN_S)
    first_value_s = time.monotonic() - started_s
    violations = violations_of(page)
    page.set_viewport_size(NARROW)
    width = int(page.evaluate("() => document.documentElement.scrollWidth"))
    page.set_viewport_size(WIDE)
    hang_s = told_s(page, shown, signal.SIGSTOP)
    shown.signal(signal.SIGCONT)
    page.wait_for_function(f"() => !({shown.silent})()", timeout=1e3 * SHOWN_S)
    end_s = told_s(page, shown, signal.SIGKILL)
    page.context.close()
    return Found(round(first_value_s, 2), hang_s, end_s, violations, width, len(elsewhere))


def violations_of(page: Page) -> int:
    """How many elements break a rule of axe-core."""
    page.evaluate(AXE.read_text(encoding="utf-8"))
    found = page.evaluate("() => axe.run(document, { resultTypes: ['violations'] })")
    return sum(len(one["nodes"]) for one in found["violations"])


def told_s(page: Page, shown: Shown, which: signal.Signals) -> float | None:
    """How long after that signal the page shows what is old as if it were true."""
    shown.signal(which)
    sent_s = time.monotonic()
    try:
        page.wait_for_function(shown.silent, timeout=1e3 * SILENCE_S)
    except TooLate:
        return None
    return round(time.monotonic() - sent_s, 2)


def program(folder: Path) -> str:
    """OctoPrint, installed in ``folder``."""
    venv.create(folder, with_pip=True)
    subprocess.run([folder / "bin" / "pip", "install", "--quiet", f"OctoPrint=={VERSION}"], check=True)
    return str(folder / "bin" / "octoprint")


@contextmanager
def octoprint(octoprint_program: str, folder: Path) -> Iterator[Shown]:
    """It and its virtual printer."""
    port, base = free_port(), ["--basedir", str(folder)]
    (folder / "config.yaml").write_text(SETTINGS)
    user = [octoprint_program, *base, "user", "add", "ann", "--password", "unused", "--admin"]
    subprocess.run(user, check=True, capture_output=True)
    serve = [octoprint_program, *base, "serve", "--iknowwhatimdoing", "--host", "127.0.0.1", "--port", str(port)]
    said = folder / "said"
    with said.open("wb") as file:
        process = subprocess.Popen(serve, stdout=file, stderr=file)
    address = f"http://127.0.0.1:{port}/"
    live = "() => /[0-9]°C/.test(document.querySelector('#temp td:nth-child(2)')?.textContent)"
    silent = "() => document.getElementById('offline_overlay')?.checkVisibility()"
    try:
        # What answers before that only says that it is starting.
        until(lambda: b"Listening on" in said.read_bytes(), STARTS_S, "OctoPrint listening")
        yield Shown(address, live, silent, process.send_signal)
    finally:
        process.kill()
        process.wait()


@contextmanager
def ours(folder: Path) -> Iterator[Shown]:
    """The service and the mock bench."""
    with served_bench("--seed", "1") as bench:
        served = ServedRig(bench, folder, bench.settings())
        made = served.ask("POST", "/auth/links", {"name": "benchmark", "scope": "operate"})
        live = "() => /[0-9]/.test(document.getElementById('position')?.textContent)"
        silent = "() => document.getElementById('state')?.textContent === 'no answer from the service'"
        yield Shown(f"{served.address}/#ticket={made['ticket']}", live, silent, served.running.process.send_signal)
        served.running.end()


def worse(us: Found, other: Found) -> list[str]:
    """In what ours is."""
    mine, theirs = (
        {name: math.inf if value is None else value for name, value in asdict(one).items()} for one in (us, other)
    )
    return [name for name in mine if mine[name] > max(theirs[name], FREE.get(name, 0))]


# A page is no better for being narrower than the screen, nor for what it says before anybody can take it in.
AT_ONCE_S = 0.2
FREE: Mapping[str, float] = {"width_at_390_px": NARROW["width"], "hang_told_s": AT_ONCE_S, "end_told_s": AT_ONCE_S}


def main() -> None:
    """Ends with 1 where OctoPrint's page is better in something."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", help="an OctoPrint that is installed already")
    given = parser.parse_args().program
    fetch(SOURCES, LIMIT_S)
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folders = [Path(name) / part for part in ("program", "octoprint", "ours")]
        for folder in folders:
            folder.mkdir()
        browser = launch(playwright, installed() or sys.exit("no browser here"))
        with octoprint(given or program(folders[0]), folders[1]) as shown:
            other = found_of(browser, shown)
        with ours(folders[2]) as shown:
            us = found_of(browser, shown)
        browser.close()
    for field, value in asdict(us).items():
        sys.stdout.write(f"{field:18} {value!s:>8} here, {getattr(other, field)!s:>8} OctoPrint {VERSION}\n")
    found = {"ours": asdict(us), "octoprint": asdict(other), "worse": worse(us, other)}
    sys.stdout.write(json.dumps(found) + "\n")
    sys.exit(bool(found["worse"]))


if __name__ == "__main__":
    main()
