"""What stands above every view: a tip that presses at rest, what came of a stop, what a stop still reaches."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from api.http.models import ControlView
from tests.page import told
from tests.page.looks import holds_up
from tests.page.pretend import IDLE, INFO, STOPPED, Pretended, Show, resting, showing
from tests.page.steps import state, view

LEASE = {"lease_id": "l", "epoch": 1, "expires": told.AT}
HELD: dict[str, Any] = {"holder": "ann", "purpose": "tracking a force", "since": told.AT}
# Whether the browser would ask before the page is left.
ASKS = """() => !window.dispatchEvent(new Event("beforeunload", { cancelable: true }))"""
STATE = "http://127.0.0.1:4711/state"
IN = {"force_N": 5.57, "depth_mm": 8.0}
BANNER = "#stop-banner"


@pytest.fixture
def service() -> Pretended:
    return resting(**{"POST estop": STOPPED})


@pytest.fixture
def show(browser: Browser, service: Pretended) -> Iterator[Show]:
    with showing(browser, service) as at:
        yield at


def bench(service: Pretended, **changed: Any) -> None:
    """The bench is at rest, but for what is ``changed``."""
    service.says(rig=IDLE.model_copy(update=changed))


def test_a_tip_that_presses_at_rest_is_told_in_every_view_with_the_way_out_and_keeps_what_moves_from_starting(
    show: Show, service: Pretended
) -> None:
    bench(service, **IN, state="stopped", reason="emergency stop pressed", mode="safe")
    page = show("bench")
    presses = page.locator("#presses")
    expect(presses).to_have_text("The tip presses with 5.6 N. Acknowledge the stop, then retract it.")
    expect(page.locator("#retract-now")).to_have_count(0)
    bench(service, **IN)
    state(page, "tip presses")
    for name in ("Bench", "Run", "Sessions", "Track", "Data", "Subjects", "Devices", "Administration"):
        view(page, name)
        expect(presses).to_have_text("The tip presses with 5.6 N. Retract it.")
        expect(page.locator("#retract-now")).to_be_enabled()
    view(page, "Track")
    expect(page.locator("#track-start-why")).to_have_text("The tip presses: retract it first.")
    holds_up(page, "state-presses-track")
    bench(service, **IN, state="running", mode="compress")
    expect(presses).to_have_count(0)
    bench(service, force_N=0.25)
    state(page, "ready")
    expect(page.locator("#track-start")).to_be_enabled()


def test_a_force_where_there_was_air_is_told_as_what_it_may_be_and_keeps_nobody_from_a_run(
    show: Show, service: Pretended
) -> None:
    bench(service, force_N=0.42, depth_mm=-4.0)
    page = show("track")
    state(page, "force at rest")
    expect(page.locator("#presses")).to_contain_text("something touches the tip, or the sensor's zero has moved")
    expect(page.locator("#track-start")).to_be_enabled()
    bench(service, force_N=0.25, depth_mm=-4.0)  # near the edge it does not come and go
    page.wait_for_timeout(600)
    state(page, "force at rest", 100.0)
    bench(service, force_N=0.1, depth_mm=-4.0)
    state(page, "ready")


def test_what_came_of_a_stop_is_gone_once_it_was_acknowledged_or_something_new_moves(
    show: Show, service: Pretended
) -> None:
    bench(service, state="running", mode="compress")
    page = show("bench")
    state(page, "running")
    page.keyboard.press("Escape")
    expect(page.locator(BANNER)).to_contain_text("confirmed by the loop: braked")
    bench(service, state="stopped", reason="emergency stop pressed", mode="safe")
    state(page, "stopped")
    expect(page.locator(BANNER)).to_be_visible()
    bench(service)
    state(page, "ready")
    expect(page.locator(BANNER)).to_have_count(0)
    page.keyboard.press("Escape")
    expect(page.locator(BANNER)).to_be_visible()
    page.wait_for_timeout(1000)
    bench(service, state="running", mode="approach")
    state(page, "running")
    expect(page.locator(BANNER)).to_have_count(0)


def test_a_silent_service_is_told_with_what_a_stop_still_reaches_and_what_came_of_one_with_its_time(
    show: Show, service: Pretended
) -> None:
    service.says(info=INFO | {"stop_port": 4711})
    page = show("bench")
    loop = {"loop": "running"}
    headers = {"Access-Control-Allow-Origin": "*"}
    page.route(STATE, lambda route: route.fulfill(json=loop, headers=headers) if loop else route.abort())
    page.route(STATE.replace("state", "estop"), lambda route: route.abort())
    state(page, "ready")
    page.keyboard.press("Escape")
    expect(page.locator(BANNER)).to_contain_text("confirmed by the loop: braked")
    expect(page.locator(BANNER)).not_to_contain_text("(at ")
    page.evaluate("() => { window.hung = true; }")
    service.says(rig=None)
    reason = page.locator("#reason")
    expect(reason).to_contain_text("STOP still works, past the service.")
    expect(page.locator(BANNER)).to_have_text(re.compile(r"braked \(at .+; what has happened since is not known"))
    loop["loop"] = "silent"
    expect(reason).to_contain_text("STOP may still work")
    loop.clear()
    expect(reason).to_contain_text("What is left is the hardware stop.")
    expect(reason).not_to_contain_text("still")
    holds_up(page, "state-gone-bench", (390,))


@pytest.mark.parametrize(
    ("holder", "who"), [("ann", "Another window that is signed in under your name"), ("eve", "Somebody else")]
)
def test_a_refusal_says_whether_the_other_is_a_window_of_ones_own_and_goes_once_nobody_is_in_control(
    show: Show, service: Pretended, holder: str, who: str
) -> None:
    page = show("bench")
    state(page, "ready")
    problem = HELD | {"title": "locked", "code": "lease-held", "detail": "", "holder": holder}
    page.route("**/control/lease", lambda route: route.fulfill(status=423, json=problem))
    bench(service, control=ControlView(**(HELD | {"holder": holder}), left_s=4.0))
    expect(page.locator("#control")).to_contain_text(f"in control: {holder}")
    page.click("#retract")
    expect(page.locator("#message")).to_contain_text(f"{who} is in control of the bench, so nothing was done")
    expect(page.locator("#take-here")).to_be_visible()
    bench(service)
    expect(page.locator("#control")).to_have_text("nobody is in control")
    expect(page.locator("#message")).to_be_empty()


def enters(page: Page, kind: str) -> None:
    """Starts it by the keyboard, which goes on from what is under way."""
    expect(page.locator(f"#{kind}-start")).to_be_enabled()
    page.locator(f"#{kind}-start").focus()
    page.keyboard.press("Enter")
    expect(page.locator(f"#{kind}-under-way")).to_be_focused()


def starts(service: Pretended, kind: str) -> None:
    """What is asked to start does."""
    begun = told.job(kind, "running")
    service.answers |= {"POST control/lease": LEASE, "PUT control/lease": LEASE}
    service.answers |= {"POST jobs": begun, f"jobs/{begun['id']}": begun}


def test_the_keyboard_goes_on_from_what_it_started_and_the_page_is_not_left_unasked_while_it_moves(
    show: Show, service: Pretended
) -> None:
    starts(service, "track")
    page = show("track")
    enters(page, "track")
    assert page.evaluate(ASKS) is False
    bench(service, state="running", mode="contact")
    state(page, "running")
    assert page.evaluate(ASKS) is True
    view(page, "Bench")
    other = show("bench")  # one that is not in control
    state(other, "running")
    assert other.evaluate(ASKS) is False


def test_the_keyboard_goes_on_from_a_capture_that_it_started(show: Show, service: Pretended) -> None:
    starts(service, "capture")
    enters(show("run"), "capture")


def test_values_that_are_not_known_or_not_as_they_seem_are_told(show: Show) -> None:
    page = show("bench")
    expect(page.locator("#force")).not_to_have_text("--")
    expect(page.locator("#unzeroed")).to_have_count(0)
    expect(page.locator(".value:has(#marker) dt")).to_have_text("marker moved")
    expect(page.locator(".readout")).to_contain_text("from where this page first has it")
    page.evaluate("() => { AT.force = AT.depth = [() => NaN, () => NaN]; }")
    expect(page.locator("#force")).to_have_text("--")
    expect(page.locator("#unzeroed")).to_contain_text("not known before the first run")
    holds_up(page, "state-unzeroed-bench")
