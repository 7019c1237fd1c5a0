"""Who is not signed in sees how to be, can stop, and sees nothing else."""

import pytest
from playwright.sync_api import Browser, expect

from api.http.access.accounts import AccountStore
from api.http.access.scopes import Scope
from api.http.access.tokens import access_folder
from tests.page.conftest import Served
from tests.page.looks import holds_up
from tests.page.people import PASSWORD, enter, visitor
from tests.page.steps import state, view


@pytest.mark.timeout(200)
def test_a_stranger_may_stop_and_nothing_else_until_a_password_lets_in(service: Served, browser: Browser) -> None:
    AccountStore(access_folder()).set("ann", Scope.OPERATE, PASSWORD)
    with visitor(browser, service) as page:
        state(page, "not signed in")
        command = f"rig token link NAME --port {service.origin.rpartition(':')[2]}"
        expect(page.locator("ol code").nth(1)).to_have_text(command)
        page.goto(f"{service.origin}/?again#ticket=used-up")
        expect(page.locator("#refusal code")).to_have_text(command)
        expect(page.get_by_role("navigation")).to_have_count(0)
        expect(page.locator("#control")).to_have_count(0)

        enter(page, "ann", "not her password")
        expect(page.locator("#refusal")).to_contain_text("name or password is wrong")
        expect(page.locator("#login-password")).to_have_value("")
        holds_up(page, "login")
        enter(page, "ann", PASSWORD)
        state(page, "ready")
        expect(page.locator("footer")).to_contain_text("Signed in as ann.")
        view(page, "Administration")
        expect(page.locator("#closed")).to_be_visible()
        expect(page.locator("#tokens")).to_have_count(0)

        page.context.clear_cookies()  # as after a working day
        expect(page.locator("#refusal")).to_contain_text("You are not signed in any more")
        page.click("#estop")
        expect(page.locator("#stop-banner")).to_contain_text("Emergency stop: confirmed by the loop")
        enter(page, "ann", PASSWORD)
        state(page, "stopped")
        expect(page.locator("#closed")).to_be_visible()  # where she was

        with page.expect_navigation():
            page.click("#logout")
        state(page, "not signed in")
        page.reload()
        state(page, "not signed in")
