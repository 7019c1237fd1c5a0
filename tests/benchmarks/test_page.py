"""What the page's benchmark makes of the moments at which a plot was drawn, and that it sees each of them."""

import pytest
from playwright.sync_api import sync_playwright

from benchmarks.page import COUNTED, rates_Hz
from tests.system.browser import find, launch

DRAWS = """async () => {
  const plot = document.body.appendChild(document.createElement("div")), other = document.body.appendChild(document.createElement("div"));
  plot.id = "force-plot";
  const of = (where) => where.appendChild(document.createElement("canvas")).getContext("2d");
  const seen = of(plot), unseen = of(other);
  for (let i = 0; i < 5; i++) {
    seen.clearRect(0, 0, 1, 1);
    unseen.clearRect(0, 0, 1, 1);
    await new Promise((done) => setTimeout(done, 20));
  }
  return window.frames_ms;
}"""  # noqa: E501 - a program of another language


def test_rates_are_one_over_the_times_between_frames() -> None:
    assert rates_Hz([0.0, 20.0, 45.0, 145.0]) == pytest.approx([50.0, 40.0, 10.0])


def test_every_drawing_of_the_plot_is_seen_and_none_of_another() -> None:
    with sync_playwright() as playwright:
        browser = launch(playwright, find())
        page = browser.new_page()
        page.add_init_script(COUNTED)
        page.goto("about:blank")
        frames = page.evaluate(DRAWS)
        browser.close()
    assert len(frames) == 5 and max(rates_Hz(frames)) <= 51.0
