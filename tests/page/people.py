"""People at pages of their own: with a password, or not signed in."""

from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, Page

from api.http.access.accounts import AccountStore
from api.http.access.scopes import Scope
from api.http.access.tokens import access_folder
from tests.page.conftest import Served

PASSWORD = "four plain words here"


@contextmanager
def visitor(browser: Browser, service: Served) -> Iterator[Page]:
    """Somebody who is not signed in."""
    context = browser.new_context()
    page = context.new_page()
    page.goto(service.address.partition("#")[0])
    yield page
    context.close()


@contextmanager
def somebody(browser: Browser, service: Served, name: str, scope: Scope) -> Iterator[Page]:
    """Somebody with an account, signed in."""
    AccountStore(access_folder()).set(name, scope, PASSWORD)
    with visitor(browser, service) as page:
        enter(page, name, PASSWORD)
        page.locator("nav").wait_for()
        yield page


def enter(page: Page, name: str, password: str) -> None:
    """Fills in the form and sends it."""
    page.fill("#login-name", name)
    page.fill("#login-password", password)
    page.click("#login-enter")
