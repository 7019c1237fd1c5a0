"""The page in a real browser over `rig serve`: live values, a capture, the big stop, recordings."""

import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect, sync_playwright

from tests.system.browser import find, launch
from tests.system.stage import PATIENCE_S, RIG, ROOT, Stage, free_port, freed, pressed
from tests.system.test_service import SHORT, SLOW

expect.set_options(timeout=PATIENCE_S * 1000)


@pytest.fixture
def page(bench: Stage, tmp_path: Path) -> Iterator[Page]:
    executable = find()
    (tmp_path / "protocols").mkdir()
    (tmp_path / "protocols" / "slow.toml").write_text(SLOW)
    (tmp_path / "protocols" / "short.toml").write_text(SHORT)
    port = free_port()
    command = [*RIG, "serve", "--port", str(port), "--protocols", "protocols", *bench.settings()]
    service = subprocess.Popen(
        command, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, text=True
    )
    assert service.stdout and service.stdout.readline().strip() == f"http://127.0.0.1:{port}/"
    try:
        with sync_playwright() as playwright:
            browser = launch(playwright, executable)
            page = browser.new_page()
            page.goto(f"http://127.0.0.1:{port}/")
            yield page
            browser.close()
    finally:
        service.terminate()
        service.wait(30)
        service.stdout.close()


def state(page: Page, name: str) -> None:
    expect(page.locator("#state")).to_have_text(re.compile(name, re.IGNORECASE))


@pytest.mark.timeout(200)
def test_a_person_runs_a_protocol_stops_it_and_finds_the_recordings(page: Page, bench: Stage) -> None:
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    state(page, "idle")
    expect(page.locator("#devices tr")).to_have_count(3)

    page.select_option("#protocol", "short")
    page.fill("#session", "first")
    page.click("text=Start capture")
    state(page, "running")
    expect(page.locator("#job-text")).to_contain_text("trial_001")
    state(page, "idle")
    expect(page.locator("#recordings")).to_contain_text("first: 1 recording,")

    expect(page.locator("#control")).to_contain_text("(this page)")
    page.click("#release")
    expect(page.locator("#control")).to_have_text("nobody is in control")

    page.select_option("#protocol", "slow")
    page.fill("#session", "second")
    page.click("text=Start capture")
    pressed(bench)
    expect(page.locator("#depth")).not_to_have_text("--")
    page.click("#estop")
    state(page, "stopped")
    expect(page.locator("#reason")).to_contain_text("emergency stop pressed")

    page.click("text=Acknowledge stop")
    state(page, "idle")
    page.click("#retract")
    freed(bench)
    assert errors == []
