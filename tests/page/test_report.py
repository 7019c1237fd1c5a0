"""A report opened from the session it is of shows itself, and is a stranger to the page that it was opened from."""

from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from tests.api.catalogue.made import make_session
from tests.page import test_data
from tests.page.conftest import Served
from tests.page.steps import view

service = test_data.service

# Whatever a report says of itself: this one tries what a script could do with the rights of whoever reads it.
PLANTED = """<!doctype html><title>report</title><style>p { color: rgb(1, 2, 3) }</style>
<body><p id="said">nothing ran</p><svg width="300" height="200"><rect width="300" height="200"/></svg>
<img id="inside" src="data:image/gif;base64,R0lGODlhAQABAIAAAAAAAP///ywAAAAAAQABAAACAUwAOw==">
<script>
  document.getElementById("said").textContent = "kept: " + localStorage.getItem("kept");
  fetch("/api/v1/rig").then((answer) => document.title = "bench: " + answer.status);
</script>
"""
DENIED = """async () => {
  const kept = () => localStorage.getItem("kept");
  const tried = { cookie: () => document.cookie, kept, opener: () => window.opener };
  const found = { asked: await fetch("/api/v1/rig").then(() => "answered", () => "refused") };
  for (const [name, read] of Object.entries(tried)) {
    try { found[name] = String(read()); } catch (error) { found[name] = error.name; }
  }
  return found;
}"""


def opened(page: Page) -> Page:
    """The report, in the tab that its link opens."""
    with page.expect_popup() as popup:
        page.click("#report")
    popup.value.wait_for_load_state("load")
    return popup.value


@pytest.fixture
def session(service: Served) -> Path:
    folder = make_session(service.folder / "sessions", "planted")
    (folder / "report.html").write_text(PLANTED)
    return folder


@pytest.mark.timeout(200)
def test_a_report_shows_its_pictures_and_can_neither_ask_the_service_nor_read_what_the_page_keeps(
    page: Page, session: Path
) -> None:
    page.evaluate("() => localStorage.setItem('kept', 'secret')")
    view(page, "Sessions")
    page.get_by_role("link", name=session.name).click()
    report = opened(page)
    expect(report.locator("#said")).to_have_text("nothing ran")
    expect(report.locator("svg")).to_be_visible()
    assert report.evaluate("() => getComputedStyle(document.getElementById('said')).color") == "rgb(1, 2, 3)"
    assert report.evaluate("() => document.getElementById('inside').naturalWidth") == 1
    denied = {"asked": "refused", "cookie": "SecurityError", "kept": "SecurityError", "opener": "null"}
    assert report.evaluate(DENIED) == denied
    report.close()

    page.context.route("**/report.html", unprotected)
    report = opened(page)
    expect(report.locator("#said")).to_have_text("kept: secret")
    expect(report).to_have_title("bench: 200")


def unprotected(route: Route) -> None:
    """The same without the policy that it is served with: the planted fault."""
    answer = route.fetch()
    headers = {name: value for name, value in answer.headers.items() if name != "content-security-policy"}
    route.fulfill(response=answer, headers=headers)
