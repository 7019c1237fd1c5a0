"""How often the page draws while the loop presses: `python -m benchmarks.page [--seconds 20]`; last line JSON.

Headless Chromium beside the mock bench, `rig serve` and the loop on this computer: force, set-point and error on the
view Bench, while a force is tracked whose set-point never rests, or half of the points would be one. Points are counted
in what the browser receives, in as long as the plot spans. A frame is one drawing of that plot, as its canvas is
cleared for it; rates are one over the time between two. Ends with 1 where a goal is missed: median 30 a second, p5
above 20, 10,000 points in each trace.
"""

import argparse
import json
import math
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Page, sync_playwright

from benchmarks.service.clients import batches
from mock_devices.testing.browser import installed, launch
from mock_devices.testing.commands import pressed, served_bench
from mock_devices.testing.models import known_session
from mock_devices.testing.service import ServedRig

TRACES = ("force", "setpoint", "error")
MODEL = "known"
# The plot's span, at 200 pairs a second.
FILLED_S = 30.0
RENEWED_S = 5.0  # a lease lasts 30 s
MEDIAN_HZ, P5_HZ, POINTS = 30.0, 20.0, 10_000
COUNTED = """
window.frames_ms = [];
const clear = CanvasRenderingContext2D.prototype.clearRect;
CanvasRenderingContext2D.prototype.clearRect = function (...of) {
  if (this.canvas.closest("#force-plot")) window.frames_ms.push(performance.now());
  return clear.apply(this, of);
};
"""


def rates_Hz(frames_ms: list[float]) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    """One over each time between two frames."""
    return 1e3 / np.diff(np.array(frames_ms, dtype=np.float64))


def points(frame: bytes) -> Iterator[tuple[int, int]]:
    """Of each batch in a message its channel, and the points it draws: least and greatest, which may be the same."""
    for batch in batches(frame):
        values = np.frombuffer(frame, "<f4", batch.columns * batch.rows, batch.at).reshape(batch.columns, batch.rows)
        seen = np.isfinite(values[0])
        yield batch.channel, int(seen.sum() + (seen & (values[0] != values[-1])).sum())


class Received:
    """Counts the points of each stream that a page receives."""

    def __init__(self) -> None:
        self.points: Counter[str] = Counter()
        self._streams: dict[int, str] = {}

    def take(self, message: str | bytes) -> None:
        """One message of the service."""
        if isinstance(message, bytes):
            for channel, count in points(message):
                self.points[self._streams[channel]] += count
            return
        for one in json.loads(message).get("channels", []):
            self._streams[one["channel"]] = one["stream"]


def waited(page: Page, seconds: float, renew: Callable[[], object]) -> None:
    """For that long, with the lease in force."""
    for _ in range(math.ceil(seconds / RENEWED_S)):
        renew()
        page.wait_for_timeout(1e3 * seconds / math.ceil(seconds / RENEWED_S))


def measured(served: ServedRig, seconds: float) -> dict[str, object]:
    """While a force is tracked."""
    made = served.ask("POST", "/auth/links", {"name": "benchmark", "scope": "operate"})
    lease, received = served.lease(), Received()
    with sync_playwright() as playwright:
        browser = launch(playwright, installed() or sys.exit("no browser here"))
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.on("websocket", lambda socket: socket.on("framereceived", received.take))
        page.add_init_script(COUNTED)
        page.goto(f"{served.address}/#ticket={made['ticket']}")
        page.locator("#force-plot canvas").wait_for()
        served.ask("POST", "/jobs", tracking(FILLED_S + seconds + 30.0), lease)
        pressed(served.bench)
        renew = partial(served.ask, "PUT", "/control/lease", lease=lease)
        waited(page, FILLED_S, renew)
        before, started_s = served.rig, time.monotonic()
        received.points.clear()
        page.evaluate("() => { window.frames_ms = []; }")
        waited(page, seconds, renew)
        rates = rates_Hz(page.evaluate("() => window.frames_ms"))
        share = FILLED_S / (time.monotonic() - started_s)
        after = served.rig
        browser.close()
    cycles = after["cycles"] - before["cycles"]
    return {
        "frames_median_Hz": round(float(np.median(rates)), 1), "frames_p5_Hz": round(float(np.percentile(rates, 5)), 1),
        "points": {name: round(share * received.points[name]) for name in TRACES},
        "missed_percent": round(100 * (after["missed"] - before["missed"]) / cycles, 3),
    }  # fmt: skip


def tracking(seconds: float) -> object:
    """A force that is asked for as long, and never rests."""
    reference = f"vibrate:0.5,mean_N=2,frequency_Hz=1,duration_s={seconds:g}"
    return {"kind": "track", "params": {"model": {"session": MODEL}, "reference": reference}}


def missed(found: Mapping[str, Any]) -> list[str]:
    """What was not reached, a sentence each."""
    median_Hz, p5_Hz = found["frames_median_Hz"], found["frames_p5_Hz"]
    return [
        *([f"{median_Hz:g} frames a second, not {MEDIAN_HZ:g}"] if median_Hz < MEDIAN_HZ else []),
        *([f"one frame in twenty at {p5_Hz:g} a second, not above {P5_HZ:g}"] if p5_Hz <= P5_HZ else []),
        *(f"{count} points of {name}, not {POINTS}" for name, count in found["points"].items() if count < POINTS),
    ]


def main() -> None:
    """Ends with 1 where a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    seconds = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as name, served_bench("--seed", "1") as bench:
        folder = Path(name)
        known_session(folder / "sessions" / MODEL)
        served = ServedRig(bench, folder, bench.settings())
        found = measured(served, seconds)
        served.running.interrupt()
        time.sleep(0.1)
        served.running.end()
    not_reached = missed(found)
    sys.stdout.write(json.dumps(found | {"missed": not_reached}) + "\n")
    sys.exit(bool(not_reached))


if __name__ == "__main__":
    main()
