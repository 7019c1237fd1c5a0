"""A new user from an empty folder: subject, threshold, capture, fit, diagnosis, tracking, from the page alone."""

import re
import zipfile

import pytest
from playwright.sync_api import Page, expect

from mock_devices.testing.commands import ServedBench
from tests.page.conftest import Served
from tests.page.looks import holds_up
from tests.page.steps import out, press, state, subject, view

# Three speeds, each thrice: the least that a diagnosis can leave out recordings of.
PROTOCOL = (
    'kind = "indentation"\nspeeds_mm_s = [5, 15, 30]\ntrials = 3\ndepth_mm = 6\nair_dwell_s = 0.3\n'
    "approach_speed_mm_s = 20\nhold_s = 0.3\nretract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 8\n"
)

# A diagnosis takes 20 s of a processor here and a report 10 s, which others use as well.
COMPUTING_MS = 180_000


@pytest.fixture
def protocols() -> dict[str, str]:
    return {"first": PROTOCOL}


@pytest.mark.timeout(800)
def test_a_new_user_goes_from_subject_to_tracking_without_reading_anything(
    page: Page, service: Served, bench: ServedBench
) -> None:
    state(page, "ready")
    view(page, "Run")
    set_up(page)
    capture(page)
    out(bench, service.origin)
    understand(page)
    track(page)
    out(bench, service.origin)
    find_threshold(page)


def set_up(page: Page) -> None:
    """Whom the session is of, and what force is never passed."""
    subject(page, "S07", "left forearm", 8)
    expect(page.locator("#message")).to_contain_text("on the bench: S07, left forearm")
    expect(page.locator("#message")).to_contain_text("pain threshold in force: 15.0 N → 8.0 N")
    state(page, "ready")
    expect(page.locator("#subject-keep-why")).to_have_text("is on the bench")

    page.fill("#threshold-known", "9")
    press(page, "#threshold-keep")
    expect(page.locator("#threshold")).to_have_text("9.0")
    state(page, "ready")
    expect(page.locator("#force-limit")).to_have_text("9.0")
    expect(page.locator("#verdict")).to_contain_text("its force is not known")
    holds_up(page, "real-run", (1280, 390))


def capture(page: Page) -> None:
    """From the start to the card that says what came of it."""
    page.fill("#session", "first")
    press(page, "#capture-start")
    expect(page.locator("#capture-under-way")).to_contain_text("of 9 trials")
    expect(page.locator("#result")).to_contain_text("Session first")
    expect(page.locator("#peak")).to_have_text(re.compile(r"^[1-8]\.\d\d$"))


def understand(page: Page) -> None:
    """Curves, fit, diagnosis and report."""
    page.click("#open-session")
    expect(page.locator("#curves canvas")).to_be_visible()
    expect(page.locator("#trials tbody tr")).to_have_count(9)
    page.click("#fit-start")
    expect(page.locator("#parameters")).to_contain_text("stiffness at contact", timeout=COMPUTING_MS)
    page.click("#diagnose-start")
    expect(page.locator("#diagnosis-result")).to_be_visible(timeout=COMPUTING_MS)
    expect(page.locator("#diagnosis-result .said")).not_to_be_empty()
    page.click("#report-start")
    expect(page.locator("#report")).to_have_attribute("href", re.compile(r"report\.html$"), timeout=COMPUTING_MS)
    with page.expect_download(timeout=COMPUTING_MS) as saved:
        page.click("#export-csv")
    assert zipfile.is_zipfile(saved.value.path())
    holds_up(page, "real-session")


def track(page: Page) -> None:
    """Two forces with the gains of what was fitted."""
    page.click("#to-track")
    expect(page.locator("#origin")).to_contain_text("fitted to the session “first”")
    page.fill("#forces", "1, 2")
    page.fill("#seconds", "2")
    press(page, "#track-start")
    state(page, "running")
    expect(page.locator("#rms")).to_have_text(re.compile(r"^0\.\d\d\d$"))
    expect(page.locator("#seconds")).to_have_value("2")
    holds_up(page, "real-track", (1280, 390))


def find_threshold(page: Page) -> None:
    """A ramp that the subject stops from the page."""
    view(page, "Run")
    expect(page.locator("#verdict")).to_contain_text("It will go as planned")
    page.click("#ramp summary")
    page.fill("#ramp-up-to", "2.5")
    press(page, "#ramp-start")
    bench_force = page.locator("#now-force").first
    expect(bench_force).to_have_text(re.compile(r"^[12]\.\d\d$"))
    page.click("#ramp-pain")
    expect(page.locator("#ramp-result")).to_contain_text("The subject stopped at")
    state(page, "stopped")
    page.click("#reset")
    state(page, "ready")
