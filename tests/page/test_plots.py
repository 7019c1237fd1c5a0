"""What the plots of the Bench view show: the last minutes, a closer look, and force against depth."""

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from hatch_build import SOURCES, built_folder
from tests.page import told
from tests.page.pretend import IDLE, INFO, OPERATOR, Pretended, opened

# Of the pretended bench: depth is 4 + 3 sin(0.9 t), and the set-point is a function of it.
MIDDLE_MM, RATE_RAD_S = 4.0, 0.9
READINGS = 6
# Keeps the points of the curve that was drawn last in the plot of force against depth.
DRAWN = """() => {
  for (const name of ["moveTo", "lineTo"]) {
    const genuine = Path2D.prototype[name];
    Path2D.prototype[name] = function (x, y) { (this.points ??= []).push([x, y]); return genuine.call(this, x, y); };
  }
  const stroke = CanvasRenderingContext2D.prototype.stroke;
  CanvasRenderingContext2D.prototype.stroke = function (...of) {
    if (of[0] && this.canvas.closest("#loop-plot")) window.loop = of[0].points;
    return stroke.apply(this, of);
  };
}"""


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """The Bench view, with half a minute of pressing behind it."""
    answers: dict[str, Any] = {"auth/me": OPERATOR, "rig": IDLE, "info": INFO}
    errors: list[str] = []
    page = opened(browser, Pretended(built_folder(SOURCES), answers | told.everything()), "bench", errors)
    expect(page.locator("#force-plot canvas")).to_be_visible()
    yield page
    page.context.close()
    assert errors == []


def step_s(page: Page, key: str) -> float:
    """How much time lies between readings that ``key`` steps over, of what stands still.

    Of readings d of a sine one step apart, d(t - s) + d(t + s) - 8 is 2 cos(0.9 s) times d(t) - 4.
    """
    plot = page.locator("#depth-plot")
    plot.focus()
    for _ in range(11):
        page.keyboard.press("PageUp")
    found = list[float]()
    for _ in range(READINGS):
        page.keyboard.press(key)
        said = page.locator(".readout").text_content() or ""
        found.append(float(re.findall(r"depth ([\d.]+) mm", said)[0]) - MIDDLE_MM)
    before, here, after = (np.array(found[place : READINGS - 2 + place]) for place in range(3))
    return math.acos(float(here @ (before + after) / (2 * here @ here))) / RATE_RAD_S


TENTHS, HUNDREDTHS = ("PageDown", 0.1), ("ArrowLeft", 0.01)


@pytest.mark.parametrize(("span_s", "step"), [(10, TENTHS), (30, TENTHS), (60, HUNDREDTHS), (120, HUNDREDTHS)])
def test_the_last_minutes_are_as_many_as_were_chosen(page: Page, span_s: float, step: tuple[str, float]) -> None:
    key, share = step
    page.select_option("#span", str(span_s))
    page.click("#plot-pause")
    assert step_s(page, key) == pytest.approx(span_s * share, rel=0.06)


def test_a_closer_look_and_one_from_further_away_halve_and_double_the_time_shown(page: Page) -> None:
    page.click("#zoom-in")
    expect(page.locator("#plot-pause")).to_have_text("Live")
    page.get_by_role("button", name="Later").click()
    assert step_s(page, "PageDown") == pytest.approx(1.5, rel=0.06)
    page.click("#zoom-out")
    page.get_by_role("button", name="Earlier").click()
    assert step_s(page, "PageDown") == pytest.approx(3.0, rel=0.06)


def test_a_part_that_is_dragged_over_is_shown_and_a_double_click_goes_back_to_live(page: Page) -> None:
    page.click("#plot-pause")
    over = page.locator("#force-plot .u-over")
    box = over.bounding_box()
    assert box
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.4 * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], y, steps=4)
    page.mouse.move(box["x"] + 0.8 * box["width"], y, steps=4)
    page.mouse.up()
    assert step_s(page, "PageDown") == pytest.approx(1.2, rel=0.06)
    over.dblclick()
    expect(page.locator("#plot-pause")).to_have_text("Pause")


def drawn(page: Page) -> np.ndarray[Any, Any]:
    """Points [px] of the curve in the plot of force against depth, as it is drawn next."""
    page.evaluate(DRAWN)
    page.evaluate("() => void (window.loop = null)")
    page.wait_for_function("() => window.loop?.length > 100")
    return np.array(page.evaluate("() => window.loop"))


def bounds_mm(page: Page) -> tuple[float, float]:
    """What the plot says it spans."""
    plot = page.locator("#loop-plot")
    return float(plot.get_attribute("data-from") or "nan"), float(plot.get_attribute("data-to") or "nan")


def test_force_is_drawn_against_depth_for_the_time_that_is_shown(page: Page) -> None:
    across_px, down_px = drawn(page).T
    # Depth goes from 1 to 7 mm, and the plot leaves 4 % at either end.
    assert bounds_mm(page) == pytest.approx((0.76, 7.24), abs=0.05)
    depth_mm = 1.0 + 6.0 * (across_px - across_px.min()) / (across_px.max() - across_px.min())
    # The force follows its set-point by 0.03 s, with a ripple of 0.02 N, in columns of 0.05 s.
    force_N = 0.12 * depth_mm * np.exp(0.22 * depth_mm)
    slope_px_N, zero_px = np.polyfit(force_N, down_px, 1)
    assert slope_px_N < 0 and np.abs(down_px - zero_px - slope_px_N * force_N).max() < 0.3 * abs(slope_px_N)
    for _ in range(4):
        page.click("#zoom-in")
    # In 1.9 s a sine of 0.9 rad/s goes through no more than twice its amplitude times sin(0.9 x 1.9 / 2).
    most_mm = 1.08 * 6.0 * math.sin(RATE_RAD_S * 30 / 16 / 2) + 0.1
    narrow = "most => (({ from, to }) => to - from <= most)(document.querySelector('#loop-plot').dataset)"
    page.wait_for_function(narrow, arg=most_mm)
