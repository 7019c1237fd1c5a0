"""Two people at one bench: who is in control, what for, and how control changes hands."""

import pytest
from playwright.sync_api import Browser, Page, expect

from api.http.access.scopes import Scope
from mock_devices.testing.commands import ServedBench, pressed
from tests.page.conftest import Served
from tests.page.looks import holds_up
from tests.page.people import somebody
from tests.page.steps import out, out_or_named, start, state, view


@pytest.mark.timeout(240)
def test_the_second_person_is_told_who_and_what_for_and_takes_over_with_a_reason(
    page: Page, service: Served, bench: ServedBench, browser: Browser
) -> None:
    state(page, "ready")
    start(page, "slow")
    pressed(bench)
    with somebody(browser, service, "ben", Scope.OPERATE) as other:
        expect(other.locator("#control")).to_contain_text(", for: running a protocol (since ")
        other.click("#take-over")
        expect(other.locator("#takeover")).to_contain_text("Only an administrator may take control now")
        expect(other.get_by_role("button", name="Take control", exact=True)).to_be_disabled()
        other.get_by_role("button", name="Leave it to them").click()
        expect(other.locator("#takeover")).to_be_hidden()

        page.click("#job-stop")
        out(bench, service.origin)
        page.click("#reset")
        state(page, "ready")
        view(other, "Devices")
        other.get_by_role("button", name="Recover…").click()
        expect(other.locator("#message")).to_contain_text("Somebody else is in control of the bench")
        expect(other.locator("#message")).to_contain_text("for: running a protocol")

        other.click("#take-here")
        holds_up(other, "takeover")
        other.fill("#takeover-reason", "Ann has left")
        other.get_by_role("button", name="Take control", exact=True).click()
        expect(other.locator("#control")).to_contain_text("(this page)")
        expect(page.locator("#message")).to_have_text(
            "ben took control of the bench from this page. The reason given: Ann has left"
        )
        expect(page.locator("#control")).to_contain_text("in control: ben, for: looking after the devices")


@pytest.mark.timeout(240)
def test_an_administrator_who_takes_over_stops_what_moves(
    page: Page, service: Served, bench: ServedBench, browser: Browser
) -> None:
    state(page, "ready")
    with somebody(browser, service, "ben", Scope.OPERATE) as other:
        start(other, "slow")
        pressed(bench)
        page.click("#take-over")
        expect(page.locator("#takeover")).to_contain_text("it stops and the tip is retracted")
        page.fill("#takeover-reason", "the limb slipped")
        page.get_by_role("button", name="Take control", exact=True).click()
        out_or_named(page, bench)
        expect(page.locator("#control")).to_contain_text("(this page)")
        expect(other.locator("#message")).to_contain_text("The reason given: the limb slipped")
