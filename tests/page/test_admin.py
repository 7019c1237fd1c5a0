"""Administration: links, tokens, accounts, and a log in which a change shows."""

import pytest
from playwright.sync_api import Browser, Page, expect

from api.http.access.accounts import AccountStore
from api.http.access.scopes import Scope
from api.http.access.tokens import TokenStore, access_folder
from tests.page.conftest import Served
from tests.page.looks import holds_up
from tests.page.people import PASSWORD
from tests.page.steps import state, view


@pytest.mark.timeout(200)
def test_an_administrator_lets_people_and_programs_in_and_sees_who_did_what(
    page: Page, service: Served, browser: Browser
) -> None:
    AccountStore(access_folder()).set("ann", Scope.OPERATE, PASSWORD)
    view(page, "Administration")
    expect(page.locator("#accounts")).to_contain_text("ann")

    page.fill("#link-name", "Ben")
    page.select_option("#link-scope", "read")
    page.click("text=Make a link")
    address = page.locator("#link-made").input_value()
    guest = browser.new_context().new_page()
    guest.goto(address)
    expect(guest.locator("footer")).to_contain_text("Signed in as Ben.")
    state(guest, "ready")
    guest.context.close()

    page.fill("#token-name", "notebook")
    page.click("text=Make a token")
    secret = page.locator("#token-made").input_value()
    caller = TokenStore(access_folder()).caller(secret)
    assert caller and (caller.name, caller.scope) == ("notebook", Scope.OPERATE)
    expect(page.locator("#tokens")).to_contain_text("notebook")
    holds_up(page, "admin")
    page.get_by_role("button", name="Revoke the token notebook…").click()
    assert TokenStore(access_folder()).caller(secret)
    page.click("text=Revoke notebook now")
    expect(page.locator("#message")).to_contain_text("The token notebook is revoked")
    assert TokenStore(access_folder()).caller(secret) is None

    page.click("text=Look again")
    expect(page.locator("#audit-whole")).to_contain_text("The log is whole")
    page.fill("#audit-search", "post /api/v1/tokens")
    expect(page.locator("#audit tr").first).to_contain_text("201")
    log = access_folder() / "audit.jsonl"
    log.write_bytes(log.read_bytes().replace(b"POST /api/v1/tokens", b"GET  /api/v1/tokens"))
    page.click("text=Look again")
    expect(page.locator("#audit-whole")).to_contain_text("The log was changed")
