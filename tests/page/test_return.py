"""Somebody watches a capture and loses the service: what the page says meanwhile, and that nothing is loaded again."""

import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from mock_devices.testing.commands import ServedBench, freed, pressed
from mock_devices.testing.service import ask
from tests.page.conftest import Served, serve
from tests.page.line import Line
from tests.page.steps import out, start, state, view

SILENT = "no answer from the service"
STALE = re.compile("stale")
NUMBER = re.compile(r"^[\d.]+$")


@pytest.fixture
def own_address(service: Served) -> str:
    """Where the service itself is, whatever line leads to it."""
    return service.origin


@pytest.fixture
def line(service: Served, own_address: str) -> Iterator[Line]:
    """Where the page is opened by; asked for before it."""
    found = Line(int(own_address.rpartition(":")[2]))
    service.address = service.address.replace(own_address, f"http://127.0.0.1:{found.port}")
    yield found
    found.close()


def captures(address: str) -> tuple[str, str]:
    """A capture that a program starts, in control for half a minute; its job and its lease."""
    lease = ask(address, "POST", "/control/lease", {"holder": "program", "ttl_s": 30.0})["lease_id"]
    asked = {"kind": "capture", "params": {"protocol": "slow", "session": "watched"}}
    return ask(address, "POST", "/jobs", asked, lease)["id"], lease


def watched(page: Page, bench: ServedBench) -> None:
    """The capture is seen on the page, which is marked: what is loaded anew has no mark."""
    page.evaluate("() => { window.mark = true; }")
    pressed(bench)
    expect(page.locator("#job-text")).to_contain_text("trial_001")
    expect(page.locator("#force")).to_have_text(NUMBER)


def lost_in_contact(page: Page, bench: ServedBench, address: str, lose: Callable[[], None]) -> None:
    """Somebody watches while the service is lost by ``lose``; the tip comes out meanwhile."""
    state(page, "ready")
    captures(address)
    watched(page, bench)
    lose()
    lost(page)
    freed(bench)


def lost(page: Page) -> None:
    """The page says so, and shows nothing old as if it were true."""
    state(page, SILENT)
    expect(page.locator("#reason")).to_contain_text("nothing shown here is true any more")
    expect(page.locator(".values")).to_have_class(STALE)
    expect(page.locator("#force")).to_have_text("--")


def back(page: Page, name: str) -> None:
    """The bench is shown again as it is, in state ``name``, on the same page."""
    state(page, name)
    expect(page.locator(".values")).not_to_have_class(STALE)
    expect(page.locator("#force")).to_have_text(re.compile(r"\d"))
    assert page.evaluate("() => window.mark === true")


@pytest.mark.timeout(240)
def test_a_page_that_is_loaded_anew_while_it_presses_has_the_curves_of_the_last_minute(
    page: Page, bench: ServedBench, service: Served
) -> None:
    state(page, "ready")
    captures(service.origin)
    watched(page, bench)
    page.reload()
    expect(page.locator("#marker")).to_have_text(NUMBER)
    page.click("#plot-pause")  # here where the marker was 6 s before
    plot = page.locator("#depth-plot")
    plot.focus()
    page.keyboard.press("PageDown")
    page.keyboard.press("PageDown")
    expect(plot).to_have_attribute("aria-valuenow", "80")
    expect(page.locator(".readout")).to_contain_text(re.compile(r"marker moved [\d.]+ mm"))


@pytest.mark.timeout(240)
def test_a_capture_goes_on_over_a_cut_line_and_is_there_again_with_what_happened(
    line: Line, page: Page, own_address: str, bench: ServedBench
) -> None:
    state(page, "ready")
    job, lease = captures(own_address)
    watched(page, bench)
    sent: list[Any] = []
    page.on("websocket", lambda socket: socket.on("framesent", lambda data: sent.append(json.loads(data))))
    line.cut()
    ask(own_address, "POST", f"/jobs/{job}/pause", lease=lease)
    lost(page)
    line.mend()
    back(page, "running")
    expect(page.locator("#job-text")).to_contain_text("trial_001")
    expect(page.locator("#happened li").filter(has_text="pausing")).to_have_count(1)
    # What the service still has of the time between is asked for.
    assert sent[0]["since_seq"]["force"] > 0

    line.cut()
    lost(page)
    page.keyboard.press("Escape")  # by the stop process, which the page knows from before
    expect(page.locator("#stop-banner")).to_contain_text("Emergency stop: confirmed by the loop: braked")


@pytest.mark.timeout(240)
def test_who_is_in_control_and_is_cut_off_from_everything_is_sent_to_the_hardware_stop_and_the_tip_is_retracted(
    page: Page, bench: ServedBench, own_address: str
) -> None:
    state(page, "ready")
    start(page, "slow")
    view(page, "Bench")
    watched(page, bench)
    page.context.set_offline(True)
    lost(page)
    page.keyboard.press("Escape")
    expect(page.locator("#stop-banner")).to_contain_text("NOT CONFIRMED: use the hardware stop")
    out(bench, own_address)
    page.context.set_offline(False)
    back(page, "stopped")
    expect(page.locator("#reason")).to_contain_text("not in control any more")
    expect(page.locator("#message")).to_contain_text("This page is not in control any more")
    expect(page.locator("#happened")).to_contain_text("control was not renewed")
    page.click("#reset")
    state(page, "ready")


@pytest.mark.by_hand
@pytest.mark.timeout(240)
def test_a_service_that_hung_tells_once_it_goes_on_why_the_capture_ended(
    page: Page, service: Served, own_address: str, bench: ServedBench
) -> None:
    lost_in_contact(page, bench, own_address, service.suspend)
    service.resume()
    back(page, "stopped")
    reason = page.locator("#reason").text_content()
    assert reason
    expect(page.locator("#happened")).to_contain_text(reason)
    expect(page.locator("#job-text")).to_have_count(0)


@pytest.mark.by_hand
@pytest.mark.timeout(240)
def test_a_service_that_was_killed_and_begun_anew_asks_who_it_is_and_says_what_became_of_the_capture(
    page: Page, service: Served, own_address: str, bench: ServedBench
) -> None:
    lost_in_contact(page, bench, own_address, service.process.kill)
    anew = serve(bench, service.folder, int(own_address.rpartition(":")[2]))
    try:
        state(page, "not signed in")
        page.goto("about:blank")
        page.goto(anew.address)
        state(page, "stopped")
        view(page, "Run")
        expect(page.locator("#capture-ended")).to_contain_text("the service ended meanwhile")
        page.click("#reset")
        state(page, "ready")
        view(page, "Bench")
        expect(page.locator("#happened li")).not_to_have_count(0)
    finally:
        anew.end()
