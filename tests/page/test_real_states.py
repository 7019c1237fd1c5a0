"""Every view in every state of a real service and bench, of one lab with a session: what it says, and that it stops.

One page goes from state to state, as that of somebody who leaves it open all day; each state ends with the bench ready.
"""

import contextlib
import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, NamedTuple
from urllib.error import HTTPError

import pytest
from playwright.sync_api import Browser, Page, Response, expect

from mock_devices.testing.commands import PATIENCE_S, ServedBench, pressed, served_bench, until
from mock_devices.testing.service import ask
from tests.api.catalogue.made import fitted, make_session
from tests.page import told
from tests.page.conftest import Served, serve
from tests.page.looks import violations
from tests.page.steps import start, state, subject, view
from tests.page.views import AT_ONCE, VIEWS, go, none_moves
from tests.system.presses import SHORT, SLOW

# Longer than the slowest computer takes to go through all views.
HELD = SLOW.replace("hold_s = 30", "hold_s = 600")
# What stands in a view once it has loaded; no session is diagnosed here.
THERE = {view: about.there for view, about in VIEWS.items()} | {"session": "#curves canvas"}
NOTHING = [about.empty for view, about in VIEWS.items() if view not in ("session", "data")]
# Two widths of the three are those of other tests.
WIDTH = 768
CONFIRMED = "Emergency stop: confirmed by the loop: "
NOBODY = "NOT CONFIRMED: use the hardware stop"
SILENT = "no answer from the service"
GONE = "What is left is the hardware stop"
# Of a service that may still answer, and of one that is not there.
LATER = re.compile("The service does not answer; this comes as soon as it does|be loaded: the service does not answer")


@dataclass
class Lab:
    """A bench, the service on it, which may be begun anew, and the one page that stays open."""

    bench: ServedBench
    service: Served
    page: Page

    def ask(self, method: str, path: str, body: object = None, lease: str = "") -> Any:
        """What a program asks for beside the page."""
        return ask(self.service.origin, method, path, body, lease)

    @contextlib.contextmanager
    def control(self) -> Iterator[str]:
        """A program is in control, by that lease."""
        lease = self.ask("POST", "/control/lease", {"holder": "program", "ttl_s": 30.0})["lease_id"]
        try:
            yield lease
        finally:
            self.ask("DELETE", "/control/lease", lease=lease)

    def done(self, kind: str, **params: object) -> None:
        """Runs an operation to its end."""
        with self.control() as lease:
            job = self.ask("POST", "/jobs", {"kind": kind, "params": params}, lease)["id"]
            until(lambda: self.ask("GET", f"/jobs/{job}")["state"] == "succeeded", PATIENCE_S, f"{kind} done")

    def acknowledge(self) -> None:
        """A stop."""
        with self.control() as lease:
            self.ask("POST", "/estop/reset", lease=lease)

    def ready(self) -> None:
        """Acknowledges whatever stop there was, and takes the tip out where it was left, until the page shows it."""
        until(self._is_ready, PATIENCE_S, "the bench ready")

    def _is_ready(self) -> bool:
        # Stops that waited for a service that hung come once it goes on, the last after one was acknowledged.
        now = self.ask("GET", "/rig")
        if now["state"] == "stopped" and not now["job"]:
            with contextlib.suppress(HTTPError):
                self.acknowledge()
        elif now["state"] == "idle" and self.bench.control.number("tip.force_N"):
            self.done("retract")
        return now["state"] == "idle" and self.page.locator("#state").text_content() == "ready"


class State(NamedTuple):
    """What the page says of it, with what reason, what a stop is answered, and what brings it about for a while."""

    word: str
    reason: str
    stop: str
    during: Callable[[Lab], AbstractContextManager[None]]
    answers: bool = True
    """Whether the service does, so that a view can still be loaded."""


@contextlib.contextmanager
def stopped(lab: Lab) -> Iterator[None]:
    lab.page.keyboard.press("Escape")
    yield


def faulty(device: str, kind: str, value: Any, over: Any) -> Callable[[Lab], AbstractContextManager[None]]:
    @contextlib.contextmanager
    def during(lab: Lab) -> Iterator[None]:
        lab.bench.control.fault(device, kind, value)
        yield
        lab.bench.control.fault(device, kind, over)

    return during


@contextlib.contextmanager
def running(lab: Lab) -> Iterator[None]:
    start(lab.page, "held", "cut-short")  # by the page, which stays in control as long as it is open
    pressed(lab.bench)
    yield
    assert lab.bench.control.number("tip.force_N") > 1.0
    stops(lab.page, CONFIRMED)
    state(lab.page, "stopped")
    released(lab.page)


@contextlib.contextmanager
def hung(lab: Lab) -> Iterator[None]:
    lab.service.suspend()
    yield
    lab.service.resume()


@contextlib.contextmanager
def cut_off(lab: Lab) -> Iterator[None]:
    lab.page.context.set_offline(True)
    yield
    lab.page.context.set_offline(False)


@contextlib.contextmanager
def killed(lab: Lab) -> Iterator[None]:
    lab.service.process.kill()
    yield
    lab.service.end()
    lab.service = serve(lab.bench, lab.service.folder, int(lab.service.origin.rpartition(":")[2]))
    state(lab.page, "not signed in")
    lab.page.goto("about:blank")
    lab.page.goto(lab.service.address)


STATES = {
    "running": State("running", "", "", running),
    "stopped": State("stopped", "emergency stop pressed", CONFIRMED, stopped),
    "lost": State("not ready", "force is", CONFIRMED, faulty("force", "unplug", True, False)),
    "degraded": State("not ready", "Hz came instead of", CONFIRMED, faulty("force", "drop", 0.5, 0.0)),
    "hung": State(SILENT, "STOP still works, past the service", CONFIRMED, hung, False),
    "cut off": State(SILENT, GONE, NOBODY, cut_off, False),
    "killed": State(SILENT, GONE, NOBODY, killed, False),
}


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory, browser: Browser) -> Iterator[Lab]:
    """With a subject, a session of theirs, and one of before that is fitted."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "protocols").mkdir()
    for name, text in {"held": HELD, "short": SHORT}.items():
        (folder / "protocols" / f"{name}.toml").write_text(text)
    fitted(make_session(folder / "sessions", "before", {"id": told.SUBJECT, "site": told.SITE}))
    with served_bench("--seed", "1", "--links", str(folder)) as bench:
        context = browser.new_context(reduced_motion="reduce", viewport={"width": WIDTH, "height": 900})
        lab = Lab(bench, serve(bench, folder), context.new_page())
        try:
            lab.page.goto(lab.service.address)
            state(lab.page, "ready")
            view(lab.page, "Run")
            subject(lab.page, told.SUBJECT, told.SITE, 11)
            expect(lab.page.locator("#subject-keep-why")).to_have_text("is on the bench")
            released(lab.page)
            lab.done("capture", protocol="short", session=told.NAME)
            yield lab
        finally:
            context.close()
            lab.service.end()


def released(page: Page) -> None:
    """The page gives back control."""
    page.click("#release")
    expect(page.locator("#control")).to_have_text("nobody is in control")


@pytest.fixture(scope="module", params=STATES)
def now(lab: Lab, request: pytest.FixtureRequest) -> Iterator[State]:
    """A state of all there are, until every view has been seen in it."""
    lab.ready()
    is_now = STATES[request.param]
    with is_now.during(lab):
        state(lab.page, is_now.word)
        yield is_now
    lab.ready()


@pytest.mark.timeout(240)
@pytest.mark.parametrize("where", VIEWS)
def test_each_view_says_how_the_bench_is_lets_nothing_be_started_and_stops_it(lab: Lab, now: State, where: str) -> None:
    page = go(lab.page, where)
    state(page, now.word)
    if now.answers:
        expect(page.locator(THERE[where])).to_be_visible()
    elif where not in AT_ONCE:
        expect(page.get_by_text(LATER).first).to_be_visible()
    if now.reason:
        expect(page.locator("#reason")).to_contain_text(now.reason)
    none_moves(page)
    said = page.locator("main").text_content() or ""
    assert not [there for there in NOTHING if there in said], "what is there is said not to be"
    if now.word == SILENT and where == "bench":
        expect(page.locator("#force")).to_have_text("--")
    assert violations(page) == []
    expect(page.locator("#estop")).to_be_in_viewport()
    if now.stop:
        stops(page, now.stop)
    if now.answers and now.stop:
        state(page, "stopped")
        if now.word != "stopped":
            lab.acknowledge()


def stops(page: Page, answer: str) -> None:
    """A stop by the keyboard, answered as it has to be: each anew, whatever stood there before."""
    asked = page.expect_response(confirms) if answer == CONFIRMED else page.expect_request("**/estop")
    with asked:
        page.keyboard.press("Escape")
    expect(page.locator("#stop-banner")).to_contain_text(answer)


def confirms(response: Response) -> bool:
    """Whether that is what the loop, or the stop process for it, says to a stop."""
    if not response.url.endswith("/estop") or not response.ok:
        return False
    said = response.json()
    return bool(said.get("confirmed") or said.get("done") is True)
