"""How often the page draws while the loop presses: `python -m benchmarks.page [--seconds 20]`; last line JSON.

Headless Chromium beside the mock bench, `rig serve` and the loop on this computer: three traces of 10,000 points each
(half a minute at 200 pairs a second) on the view Bench. A frame is one drawing of that plot, as its canvas is cleared
for it; rates are one over the time between two. Ends with 1 where a goal is missed: median 30 a second, p5 above 20.
"""

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from mock_devices.testing.commands import pressed, served_bench
from mock_devices.testing.service import ServedRig
from tests.system.browser import installed, launch

PROTOCOL = (
    'kind = "indentation"\nspeeds_mm_s = [20]\ntrials = 1\ndepth_mm = 6\nair_dwell_s = 0.2\napproach_speed_mm_s = 20\n'
    "hold_s = {hold_s}\nretract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 12\n[quality]\nrepeats = 0\n"
)
# The page keeps pairs at 200 Hz: 12,000 points of each trace within the span of 30 s.
FILLED_S = 30.0
RENEWED_S = 5.0  # a lease lasts 30 s
MEDIAN_HZ, P5_HZ = 30.0, 20.0
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


def waited(page: Page, seconds: float, renew: Callable[[], object]) -> None:
    """For that long, with the lease in force."""
    for _ in range(math.ceil(seconds / RENEWED_S)):
        renew()
        page.wait_for_timeout(1e3 * seconds / math.ceil(seconds / RENEWED_S))


def drawn(page: Page, seconds: float, renew: Callable[[], object]) -> list[float]:
    """When the plot was drawn, for that long once its traces are full."""
    waited(page, FILLED_S, renew)
    page.evaluate("() => { window.frames_ms = []; }")
    waited(page, seconds, renew)
    frames: list[float] = page.evaluate("() => window.frames_ms")
    return frames


def measured(served: ServedRig, seconds: float) -> dict[str, float]:
    """While a capture holds in contact."""
    made = served.ask("POST", "/auth/links", {"name": "benchmark", "scope": "operate"})
    lease = served.lease()
    body = {"kind": "capture", "params": {"protocol": "hold", "session": "frames"}}
    with sync_playwright() as playwright:
        browser = launch(playwright, installed() or sys.exit("no browser here"))
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.add_init_script(COUNTED)
        page.goto(f"{served.address}/#ticket={made['ticket']}")
        page.locator("#force-plot canvas").wait_for()
        served.ask("POST", "/jobs", body, lease)
        pressed(served.bench)
        before = served.rig
        rates = rates_Hz(drawn(page, seconds, lambda: served.ask("PUT", "/control/lease", lease=lease)))
        after = served.rig
        browser.close()
    cycles = after["cycles"] - before["cycles"]
    return {
        "frames_median_Hz": round(float(np.median(rates)), 1), "frames_p5_Hz": round(float(np.percentile(rates, 5)), 1),
        "missed_percent": round(100 * (after["missed"] - before["missed"]) / cycles, 3),
    }  # fmt: skip


def main() -> None:
    """Ends with 1 where a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    seconds = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as name, served_bench("--seed", "1") as bench:
        folder = Path(name)
        (folder / "protocols").mkdir()
        hold_s = FILLED_S + seconds + 30.0
        (folder / "protocols" / "hold.toml").write_text(PROTOCOL.format(hold_s=hold_s))
        settings = bench.settings()
        served = ServedRig(bench, folder, ["--protocols", "protocols", *settings])
        found = measured(served, seconds)
        served.running.interrupt()
        time.sleep(0.1)
        served.running.end()
    sys.stdout.write(json.dumps(found) + "\n")
    sys.exit(found["frames_median_Hz"] < MEDIAN_HZ or found["frames_p5_Hz"] <= P5_HZ)


if __name__ == "__main__":
    main()
