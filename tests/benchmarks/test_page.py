"""What the page's benchmark makes of the moments at which a plot was drawn, and that it sees each of them."""

import json
import struct

import pytest
from playwright.sync_api import sync_playwright

from benchmarks.page import COUNTED, Received, missed, rates_Hz
from mock_devices.testing.browser import launch
from tests.system.browser import find

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


def batch(channel: int, *columns: tuple[float, ...]) -> bytes:
    """As docs/api/streams.md says: header, times [ns], columns one after the other."""
    count = len(columns[0])
    times = struct.pack(f"<{count}i", *range(count))
    return (
        struct.pack("<HHIqII", channel, len(columns), 7, 0, count, count)
        + times
        + b"".join(struct.pack(f"<{count}f", *column) for column in columns)
    )


def test_points_are_the_least_and_the_greatest_where_they_differ_and_none_that_is_not_drawn() -> None:
    nothing = float("nan")
    received = Received()
    channels = [{"channel": 1, "stream": "force"}, {"channel": 2, "stream": "setpoint"}]
    received.take(json.dumps({"type": "subscribed", "channels": channels}))
    received.take(json.dumps({"type": "event", "seq": 1}))
    force = batch(1, (1.0, 2.0, 3.0, nothing), (1.5, 2.0, 4.0, nothing))
    received.take(force + batch(2, (2.0, 2.0), (2.0, 2.0)))
    received.take(force)
    assert received.points == {"force": 10, "setpoint": 2}


def test_a_trace_of_one_point_where_two_are_meant_is_reported() -> None:
    """The planted benchmark: a set-point that rests, of which least and greatest are one."""
    found = {"frames_median_Hz": 40.0, "frames_p5_Hz": 30.0, "points": {"force": 12_000, "setpoint": 6_000}}
    assert missed(found) == ["6000 points of setpoint, not 10000"]
    assert missed(found | {"points": {"force": 10_000}}) == []
    slow = missed(found | {"points": {}, "frames_median_Hz": 29.9, "frames_p5_Hz": 20.0})
    assert slow == ["29.9 frames a second, not 30", "one frame in twenty at 20 a second, not above 20"]
