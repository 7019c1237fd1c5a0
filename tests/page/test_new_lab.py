"""Every view of a real service that has neither a bench nor a session yet, for whoever may come to it."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from playwright.sync_api import Browser, Page, expect

from api.http.access.scopes import Scope
from tests.page.conftest import Served, serve_alone
from tests.page.looks import WIDTHS, tabbed_through, violations
from tests.page.people import somebody, visitor
from tests.page.steps import state
from tests.page.views import VIEWS, go, none_moves, none_starts

Open = Callable[[str, str], Page]
EMPTY = {where: about.empty for where, about in VIEWS.items()} | {
    "subject": "has no session in sessions and no name",
    "admin": "The log is whole",
}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    served = serve_alone(tmp_path_factory.mktemp("new"))
    yield served
    served.end()


@pytest.fixture(scope="module")
def people(service: Served, browser: Browser) -> Iterator[dict[str, Page]]:
    """A page of each."""
    with ExitStack() as opened:
        pages = {"stranger": opened.enter_context(visitor(browser, service))}
        pages["reader"] = opened.enter_context(somebody(browser, service, "eve", Scope.READ))
        pages["administrator"] = opened.enter_context(visitor(browser, service))
        pages["administrator"].goto(service.address)
        state(pages["administrator"], "disconnected")
        yield pages


@pytest.fixture
def show(people: dict[str, Page]) -> Open:
    def at(who: str, where: str) -> Page:
        return go(people[who], where)

    return at


def refused(page: Page) -> None:
    """A stop that nothing can confirm, as there is no bench, is not said to be one."""
    with page.expect_response(lambda answer: answer.url.endswith("/estop") and not answer.ok):
        page.keyboard.press("Escape")
    expect(page.locator("#stop-banner")).to_contain_text("NOT CONFIRMED: use the hardware stop")


@pytest.mark.parametrize("where", VIEWS)
def test_where_there_is_nothing_yet_each_view_says_so_and_can_be_walked_through_by_keyboard(
    show: Open, where: str
) -> None:
    page = show("administrator", where)
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 700})
        page.reload()  # a walk begins above
        state(page, "disconnected")
        expect(page.locator("main")).to_contain_text(EMPTY[where])
        expect(page.locator("#reason")).to_contain_text("/dev/no-sensor: cannot be opened")
        none_moves(page)
        assert tabbed_through(page) == []
        assert violations(page) == []
    refused(page)


@pytest.mark.parametrize("where", VIEWS)
def test_who_may_only_look_is_told_so_and_may_stop(show: Open, where: str) -> None:
    page = show("reader", where)
    if where == "admin":
        expect(page.locator("#closed")).to_be_visible()
    expect(page.locator("main")).to_contain_text("You may look, not operate")
    for way in ("#connect", "#recover", "#reset"):
        expect(page.locator(way)).to_have_count(0)
    none_starts(page)
    refused(page)


@pytest.mark.parametrize("where", VIEWS)
def test_a_stranger_sees_nothing_of_any_view_but_the_stop(show: Open, where: str) -> None:
    page = show("stranger", where)
    expect(page.locator("#login")).to_be_visible()
    expect(page.get_by_role("navigation")).to_have_count(0)
    expect(page.locator(VIEWS[where].there)).to_have_count(0)
    assert violations(page) == []
    refused(page)
