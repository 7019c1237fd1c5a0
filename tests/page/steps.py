"""What a person does on the page, a step a function."""

import re

from playwright.sync_api import Page, expect


def state(page: Page, name: str) -> None:
    """Waits until the page says that the bench is in state ``name``."""
    expect(page.locator("#state")).to_have_text(re.compile(name, re.IGNORECASE))


def view(page: Page, name: str) -> None:
    """Goes to a view by its link."""
    page.get_by_role("navigation").get_by_role("link", name=name, exact=True).click()


def start(page: Page, protocol: str, session: str = "") -> None:
    """Starts a capture on the view Run."""
    view(page, "Run")
    page.select_option("#protocol", protocol)
    if session:
        page.fill("#session", session)
    page.click("#capture-start")
