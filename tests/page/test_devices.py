"""Devices: how each is, the check of each, one that is lost and comes back, and what they were calibrated by."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from mock_devices.testing.commands import ServedBench, served_bench
from tests.page.looks import holds_up
from tests.page.steps import state, view


@pytest.fixture
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedBench]:
    """One whose lines have lasting names, as cables that are plugged in again."""
    with served_bench("--seed", "1", "--links", str(tmp_path_factory.mktemp("links"))) as served:
        yield served


@pytest.mark.timeout(200)
def test_devices_are_checked_lost_and_found_again(page: Page, bench: ServedBench) -> None:
    state(page, "ready")
    view(page, "Devices")
    rows = page.locator("#devices tr")
    expect(rows).to_have_count(3)
    expect(rows.first).to_contain_text("works")
    expect(page.locator("#calibrations")).to_contain_text("in use")

    page.click("#doctor")
    expect(page.locator("#doctor-verdict")).to_have_text("All 3 devices answer as they should.")
    holds_up(page, "devices")
    bench.control.fault("tracker", "unplug", True)
    state(page, "not ready")
    expect(rows.last.locator(".no").first).to_contain_text(re.compile("lost|coming back"))
    page.click("#doctor")
    expect(page.locator("#doctor-verdict")).to_have_text("1 device has a problem.")
    holds_up(page, "devices-lost", widths=(1280, 390))
    bench.control.fault("tracker", "unplug", False)
    state(page, "ready")

    bench.control.fault("force", "drop", 0.5)
    state(page, "not ready")
    expect(rows.first).to_contain_text("works, but not as it should")
    expect(rows.first).to_contain_text(re.compile(r"\d+ Hz came instead of \d+ Hz"))
    holds_up(page, "devices-degraded", widths=(1280, 390))
    bench.control.fault("force", "drop", 0.0)
    state(page, "ready")
