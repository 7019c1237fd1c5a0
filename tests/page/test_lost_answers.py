"""What the page does where one answer is lost, broken or none of the kind, of a service that goes on."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, Response, Route, expect

from tests.page import told
from tests.page.pretend import ADDRESS, API, IDLE, INFO, Pretended, Show, resting, showing
from tests.page.steps import state, view

DIRECT = "http://127.0.0.1:4711/estop"
LEASE = {"lease_id": "l", "epoch": 1, "expires": told.AT}
MINE = IDLE.model_copy(update={"control": IDLE.control.model_copy(update={"holder": "ann", "since": told.AT})})
GONE = IDLE.model_copy(update={"state": "disconnected", "reason": "the cable of /dev/ttyUSB0"})
# A line that nobody closed is given up after 10 s.
GIVEN_UP_MS = 20_000
# An answer that has come is not at once one that the page has read; nothing on it shows when.
TAKEN_MS = 500


@pytest.fixture
def service() -> Pretended:
    return resting()


@pytest.fixture
def show(browser: Browser, service: Pretended) -> Iterator[Show]:
    with showing(browser, service) as at:
        yield at


def told_where(page: Page, service: Pretended) -> None:
    """The service says where the stop process listens; the page has heard it."""
    with page.expect_response(lambda answer: answer.url.endswith("/info") and answer.ok):
        service.says(info=INFO | {"stop_port": 4711})
    page.wait_for_timeout(TAKEN_MS)


def stops_directly(page: Page) -> None:
    """A stop goes to the stop process itself too."""
    page.route(DIRECT, lambda route: route.fulfill(json={"confirmed": True, "done": "braked", "id": 1, "after_ms": 1}))
    with page.expect_request(DIRECT):
        page.keyboard.press("Escape")


def test_the_way_to_a_stop_is_asked_for_until_it_is_told(show: Show, service: Pretended) -> None:
    service.says(info=503)
    page = show("bench")
    state(page, "ready")
    told_where(page, service)
    stops_directly(page)


def test_a_bench_that_is_connected_later_is_stopped_by_its_own_stop_process_from_then_on(
    show: Show, service: Pretended
) -> None:
    service.says(rig=GONE)
    page = show("bench")
    state(page, "disconnected")
    told_where(page, service)
    service.says(rig=IDLE)
    state(page, "ready")
    stops_directly(page)


def renewed(answer: Response) -> bool:
    return answer.request.method == "PUT" and answer.url.endswith("/control/lease")


def test_control_is_kept_where_a_renewal_is_answered_by_a_service_too_busy_for_it(
    show: Show, service: Pretended
) -> None:
    retracts = told.job("retract", "running", session=None)
    service.answers |= {"POST control/lease": LEASE, "PUT control/lease": LEASE, "POST jobs": retracts}
    page = show("bench")
    page.click("#retract")
    service.says(rig=MINE)
    expect(page.locator("#release")).to_be_visible()
    service.answers["PUT control/lease"] = 503
    for _ in range(2):
        with page.expect_response(renewed) as answered:
            pass
        assert answered.value.status == 503
    expect(page.locator("#release")).to_be_visible()
    service.answers["PUT control/lease"] = 423
    expect(page.locator("#release")).to_have_count(0)


def test_what_a_view_needs_is_asked_for_again_where_its_answer_was_lost(show: Show) -> None:
    page = show("bench")
    state(page, "ready")
    lost: list[str] = []

    def lose(route: Route) -> None:
        if len(lost) == 2:  # once it is known who lies on the bench they are asked for anew
            return route.fallback()
        lost.append(route.request.url)
        if len(lost) == 1:
            return route.abort("connectionreset")
        return route.fulfill(content_type="application/json", body='{"items": [')

    page.route(re.compile(re.escape(f"{ADDRESS}{API}models")), lose)
    view(page, "Track")
    expect(page.locator("#origin")).to_contain_text(f"fitted to the session “{told.NAME}”")
    expect(page.locator("#track-start")).to_be_enabled()
    assert len(lost) == 2


def test_a_stream_that_is_silent_and_never_closed_is_opened_anew(show: Show) -> None:
    page = show("track")
    expect(page.locator("#track-start")).to_be_enabled()
    page.evaluate("() => { window.socket.dead = true; }")
    state(page, "no answer from the service")
    expect(page.locator("#track-start")).to_be_disabled()
    state(page, "ready", GIVEN_UP_MS)
    expect(page.locator("#track-start")).to_be_enabled()


def test_an_address_that_is_no_code_of_letters_is_a_session_that_is_not_there(show: Show) -> None:
    page = show("session/%")
    state(page, "ready")
    expect(page.locator("h1")).to_have_text("%")
    expect(page.locator("main")).to_contain_text("is refused here")
