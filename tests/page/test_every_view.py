"""Every view in every state that a bench, a service, a login or a browser can be in; none hides the stop.

One page goes from test to test, over a service that only pretends: it is loaded anew for each.
"""

import itertools
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from api.http.models import ControlView
from hatch_build import SOURCES, built_folder
from tests.page import told, told_lab
from tests.page.looks import STOP, WIDTHS, holds_up, stops, tabbed_through, violations
from tests.page.pretend import ADDRESS, ADMINISTRATOR, IDLE, INFO, OPERATOR, STOPPED, Pretended, opened
from tests.page.views import AT_ONCE, MOVES, VIEWS, none_starts

WALKS = 3
Show = Callable[[str], Page]


@pytest.fixture(scope="module")
def pretended() -> Pretended:
    return Pretended(built_folder(SOURCES))


@pytest.fixture(scope="module")
def errors() -> list[str]:
    return []


@pytest.fixture(scope="module")
def only_page(browser: Browser, pretended: Pretended, errors: list[str]) -> Iterator[Page]:
    pretended.answers = everything()
    page = opened(browser, pretended, "bench", errors)
    yield page
    page.context.close()


def everything() -> dict[str, Any]:
    """At rest, with one session, for somebody who may do everything."""
    now: dict[str, Any] = {"auth/me": ADMINISTRATOR, "rig": IDLE, "info": INFO, "POST estop": STOPPED}
    return now | told.everything() | told_lab.around()


def asked_for() -> dict[str, Any]:
    """What views ask for, beside what every page does."""
    return told.everything() | told_lab.around()


@pytest.fixture
def service(pretended: Pretended, errors: list[str]) -> Iterator[Pretended]:
    pretended.answers = everything()
    pretended.asked.clear()
    errors.clear()
    yield pretended
    assert errors == []


@pytest.fixture
def show(service: Pretended, only_page: Page) -> Show:
    """Loads a view in the one page."""

    def at(view: str) -> Page:
        only_page.set_viewport_size({"width": 1280, "height": 900})
        only_page.goto(f"{ADDRESS}?{next(TIMES)}#/{VIEWS[view].place}")
        return only_page

    return at


TIMES = itertools.count()


def loaded(page: Page, view: str) -> Page:
    """Once it is there."""
    expect(page.locator(VIEWS[view].there)).to_be_visible()
    return page


@pytest.mark.parametrize("view", VIEWS)
def test_each_view_holds_up_for_everybody_at_every_width_and_in_both_schemes(
    show: Show, service: Pretended, view: str
) -> None:
    page = loaded(show(view), view)
    holds_up(page, f"state-there-{view}")
    stops(page, service)


@pytest.mark.parametrize("view", VIEWS)
def test_the_keyboard_alone_comes_to_everything_sees_where_it_is_and_presses_stop(
    show: Show, service: Pretended, view: str
) -> None:
    page = loaded(show(view), view)
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 700})
        # On a busy computer values may be old, and what acts on them greyed, just while it is walked through.
        walks = [tabbed_through(page)]
        while walks[-1] and len(walks) < WALKS:
            walks.append(tabbed_through(page))
        assert walks[-1] == [], width
    page.locator("#estop").focus()
    page.keyboard.press("Enter")
    expect(page.locator("#stop-banner")).to_contain_text("Emergency stop: confirmed by the loop: braked")
    assert service.asked.count(STOP) == 1


def test_what_the_keyboard_does_not_come_to_or_comes_to_unseen_is_found(show: Show) -> None:
    page = loaded(show("run"), "run")
    hiding = "#capture-start:focus-visible { outline: none } #threshold-known { margin-left: -200vw }"
    page.add_style_tag(content=hiding)
    page.evaluate("""() => {
      const lost = document.getElementById("logout");
      lost.addEventListener("focus", () => lost.blur());
    }""")
    wrong = "\n".join(tabbed_through(page))
    assert re.search(r'id="capture-start".* has no mark of the focus', wrong)
    assert re.search(r'id="threshold-known".* is out of sight', wrong)
    assert re.search(r'id="logout".* is not reached', wrong)


@pytest.mark.parametrize("view", VIEWS)
def test_where_there_is_nothing_yet_each_view_says_what_to_do(show: Show, service: Pretended, view: str) -> None:
    bare = IDLE.model_copy(update={"devices": {}, "health": {}, "rates_Hz": {}})
    service.answers |= dict.fromkeys(asked_for(), 404) | told.nothing() | told_lab.bare() | {"rig": bare}
    page = show(view)
    expect(page.locator("main")).to_contain_text(VIEWS[view].empty)
    holds_up(page, f"state-empty-{view}", (390,))
    stops(page, service)


@pytest.mark.parametrize("view", [view for view in VIEWS if view not in AT_ONCE])
def test_while_a_view_loads_it_says_so_and_a_refusal_is_shown_in_the_services_own_words(
    show: Show, service: Pretended, view: str
) -> None:
    service.answers |= dict.fromkeys(asked_for())
    page = show(view)
    expect(page.get_by_text("Loading").first).to_be_visible()
    stops(page, service)
    service.answers |= dict.fromkeys(asked_for(), 500)
    page = show(view)
    expect(page.locator("main")).to_contain_text("is refused here")
    expect(page.get_by_role("button", name="Try again").first).to_be_visible()
    assert violations(page) == []


def test_before_anything_is_known_of_the_bench_its_values_are_shown_as_not_known(
    show: Show, service: Pretended
) -> None:
    service.answers["rig"] = None
    page = show("bench")
    expect(page.locator("#state")).to_have_text("connecting…")
    stops(page, service)


NAMED = "no answer from the service"
# What the page does where nothing comes, and after how long [ms]; it looks ten times a second, and then has to draw.
TOLD_MS = {"no news for half a second": 500.0, "grey": 500.0, NAMED: 1000.0}
LATE_MS = 250.0
GREYED = ("bench", "devices", "track")
# Silences the stream; when after its last word the page did each of these, by its own clock, and those it did in 5 s.
SILENCE = """(named) => new Promise((done) => {
  const after_ms = {}, state = document.getElementById("state");
  const look = () => {
    const now_ms = performance.now() - window.said_ms;
    if (state.textContent.startsWith("no ")) after_ms[state.textContent] ??= now_ms;
    if (document.querySelector(".stale")) after_ms.grey ??= now_ms;
    if (after_ms[named]) end();
  };
  const watched = new MutationObserver(look), late = setTimeout(() => end(), 5000);
  const end = () => { watched.disconnect(); clearTimeout(late); done(after_ms); };
  window.hung = true;
  watched.observe(document.body, { subtree: true, childList: true, characterData: true, attributes: true });
})"""


def silenced(page: Page) -> dict[str, float]:
    """What the page did in silence, and when [ms].

    A computer at work elsewhere may let it be late, or what it asks for itself come late before; not each time.
    """
    found: dict[str, float] = page.evaluate(SILENCE, NAMED)
    for _ in range(WALKS - 1):
        if all(0 <= at_ms - TOLD_MS[word] < LATE_MS for word, at_ms in found.items()):
            break
        page.evaluate("() => { window.hung = false; }")
        expect(page.locator("#state")).to_have_text("ready")
        found = page.evaluate(SILENCE, NAMED)
    return found


@pytest.mark.parametrize("view", VIEWS)
def test_a_service_that_hangs_is_told_after_half_a_second_and_named_after_a_whole_and_nothing_can_be_started(
    show: Show, service: Pretended, view: str
) -> None:
    page = loaded(show(view), view)
    expect(page.locator("#state")).to_have_text("ready")
    told_ms = silenced(page)
    for word, at_ms in told_ms.items():
        assert at_ms == pytest.approx(TOLD_MS[word] + LATE_MS / 2, abs=LATE_MS / 2), told_ms
    assert set(told_ms) == set(TOLD_MS if view in GREYED else ("no news for half a second", NAMED))
    service.answers["rig"] = None
    expect(page.locator("#state")).to_have_text("no answer from the service")
    expect(page.locator("#reason")).to_contain_text("Use the hardware stop if in doubt")
    none_starts(page)
    if view == "bench":
        expect(page.locator("#force")).to_have_text("--")
        expect(page.locator(".values")).to_have_class(re.compile("stale"))
    holds_up(page, f"state-hung-{view}", (390,))
    stops(page, service)


def test_a_service_that_hung_is_there_again_once_it_speaks(show: Show, service: Pretended) -> None:
    page = loaded(show("bench"), "bench")
    page.evaluate("() => { window.hung = true; }")
    expect(page.locator("#force")).to_have_text("--")
    page.evaluate("() => { window.hung = false; }")
    expect(page.locator("#state")).to_have_text("ready")
    expect(page.locator("#force")).not_to_have_text("--")


# Ends the connection; what the page says once it has drawn.
ENDED = """() => new Promise((done) => {
  socket.dead = true;
  socket.onclose();
  setTimeout(() => done(document.getElementById("state").textContent), 100);
})"""


def test_a_connection_that_ends_is_told_at_once_and_forgotten_once_there_is_another(
    show: Show, service: Pretended
) -> None:
    page = loaded(show("bench"), "bench")
    expect(page.locator("#state")).to_have_text("ready")
    assert page.evaluate(ENDED) == NAMED
    expect(page.locator("#state")).to_have_text("ready")


WRONG = {
    "lost": ({"state": "disconnected", "reason": "force is lost: the cable of /dev/ttyUSB0"}, "Connect devices"),
    "stopped": ({"state": "stopped", "reason": "emergency stop pressed"}, "Acknowledge stop"),
    "degraded": ({"state": "not ready", "reason": "tracker is degraded: 20 of 60 Hz"}, "Recover…"),
}


@pytest.mark.parametrize("view", VIEWS)
def test_what_is_wrong_with_the_bench_stands_above_and_beside_every_start(
    show: Show, service: Pretended, view: str
) -> None:
    page = loaded(show(view), view)
    for wrong, (changed, button) in WRONG.items():
        service.answers["rig"] = IDLE.model_copy(update=changed)
        expect(page.locator("#reason")).to_have_text(changed["reason"])
        expect(page.get_by_role("button", name=button).first).to_be_enabled()
        if view in MOVES:
            expect(page.locator(MOVES[view])).to_be_disabled()
            holds_up(page, f"state-{wrong}-{view}", (390,))
        stops(page, service)
    if view in ("run", "track"):
        expect(page.locator(f"{MOVES[view]}-why")).not_to_be_empty()


@pytest.mark.parametrize("view", VIEWS)
def test_whoever_may_only_look_is_told_so_and_whoever_is_signed_out_meanwhile_how_to_come_in(
    show: Show, service: Pretended, view: str
) -> None:
    service.answers["auth/me"] = OPERATOR | {"scopes": ["read"]}
    page = show(view)
    if view == "admin":
        expect(page.locator("#closed")).to_be_visible()
    else:
        loaded(page, view)
    if view not in ("bench", "sessions", "subjects", "admin"):
        expect(page.locator("main")).to_contain_text("You may look, not operate")
    assert violations(page) == []
    service.answers["rig"] = 401
    expect(page.locator("#login")).to_be_visible()
    expect(page.locator("#refusal")).to_contain_text("You are not signed in any more")
    stops(page, service)


def test_the_login_holds_up_is_tabbed_through_and_stops(show: Show, service: Pretended) -> None:
    service.answers["auth/me"] = 401
    page = show("bench")
    expect(page.locator("#login")).to_be_visible()
    holds_up(page, "state-login")
    assert tabbed_through(page) == []
    page.click("#estop")
    expect(page.locator("#stop-banner")).to_contain_text("confirmed by the loop")


HELD = IDLE.model_copy(update={"control": ControlView(holder="eve", purpose="a run", since=told.AT, left_s=4.0)})


@pytest.mark.parametrize("moving", [False, True])
def test_the_stop_is_in_reach_of_the_mouse_and_of_the_keyboard_while_control_is_taken(
    show: Show, service: Pretended, moving: bool
) -> None:
    service.answers["rig"] = HELD.model_copy(update={"state": "running"}) if moving else HELD
    page = show("run")
    page.click("#take-over")
    expect(page.locator("#takeover")).to_contain_text("eve")
    expect(page.locator("#takeover-reason")).to_be_focused()
    holds_up(page, f"state-takeover-{'moving' if moving else 'at-rest'}")
    page.click("#estop")
    expect(page.locator("#stop-banner")).to_contain_text("confirmed by the loop")
    expect(page.locator("#takeover")).to_be_visible()
    page.fill("#takeover-reason", "she has left")
    stops(page, service)
    expect(page.locator("#takeover")).to_be_hidden()


def test_the_stop_is_in_reach_while_the_bench_asks_for_consent(show: Show, service: Pretended) -> None:
    question = {"act": "retract", "question": "May the tip be taken out of the tissue?"}
    found = {"happened": ["the loop ended"], "open": [question], "done": [], "ready": False, "missing": ""}
    service.answers |= {"POST recover": found, "POST control/lease": {"lease_id": "l", "epoch": 1, "expires": told.AT}}
    page = show("devices")
    page.click("#start-recovery")
    expect(page.locator("#recovery")).to_contain_text("May the tip be taken out of the tissue?")
    expect(page.get_by_role("button", name="No", exact=True)).to_be_focused()
    holds_up(page, "state-recovery")
    page.click("#estop")
    expect(page.locator("#stop-banner")).to_contain_text("confirmed by the loop")
