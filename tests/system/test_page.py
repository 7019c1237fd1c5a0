"""The page in a real browser over `rig serve`: live values, a capture, the big stop, recordings."""

import os
import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect, sync_playwright

from mock_devices.testing.commands import PATIENCE_S, RIG, ROOT, ServedBench, children, free_port, freed, pressed
from tests.system.browser import find, launch
from tests.system.test_service import SHORT, SLOW

expect.set_options(timeout=PATIENCE_S * 1000)


@pytest.fixture
def service(bench: ServedBench, tmp_path: Path) -> Iterator[tuple["subprocess.Popen[str]", str]]:
    """A served bench, and where its page is."""
    find()
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
        yield service, f"http://127.0.0.1:{port}/"
    finally:
        service.send_signal(signal.SIGCONT)
        service.terminate()
        service.wait(30)
        service.stdout.close()


@pytest.fixture
def page(service: tuple["subprocess.Popen[str]", str]) -> Iterator[Page]:
    with sync_playwright() as playwright:
        browser = launch(playwright, find())
        page = browser.new_context().new_page()
        page.goto(service[1])
        yield page
        browser.close()


def state(page: Page, name: str) -> None:
    expect(page.locator("#state")).to_have_text(re.compile(name, re.IGNORECASE))


@pytest.mark.timeout(200)
def test_a_person_runs_a_protocol_stops_it_and_finds_the_recordings(page: Page, bench: ServedBench) -> None:
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
    expect(page.locator("#stop-banner")).to_contain_text("Emergency stop: confirmed by the loop: braked")
    state(page, "stopped")
    expect(page.locator("#reason")).to_contain_text("emergency stop pressed")

    page.click("text=Acknowledge stop")
    state(page, "idle")
    page.click("#retract")
    freed(bench)
    assert errors == []


@pytest.mark.timeout(200)
def test_the_stop_is_confirmed_with_six_more_tabs_and_a_service_that_stands_still(
    page: Page, service: tuple["subprocess.Popen[str]", str], bench: ServedBench
) -> None:
    process, address = service
    state(page, "idle")
    page.select_option("#protocol", "slow")
    page.click("text=Start capture")
    pressed(bench)
    for _ in range(6):  # a browser opens no more connections to one address, and live values hold one each
        page.context.new_page().goto(address, wait_until="commit")
    process.send_signal(signal.SIGSTOP)
    page.bring_to_front()
    page.keyboard.press("Escape")
    expect(page.locator("#stop-banner")).to_contain_text("Emergency stop: confirmed by the loop: braked")
    state(page, "no answer from the service")
    expect(page.locator("#force")).to_have_text("--")
    assert bench.control.get("axis.velocity_mm_s")["axis.velocity_mm_s"] == pytest.approx(0, abs=0.5)


@pytest.mark.timeout(200)
def test_a_stop_that_nobody_confirms_sends_to_the_hardware_stop(
    page: Page, service: tuple["subprocess.Popen[str]", str]
) -> None:
    process, _ = service
    state(page, "idle")
    (loop,) = children(process.pid, "controller.loop.process")
    (stops,) = children(process.pid, "controller.stop.server")
    for pid in (process.pid, loop, stops):
        os.kill(pid, signal.SIGSTOP)
    page.click("#estop")
    expect(page.locator("#stop-banner")).to_contain_text("NOT CONFIRMED: use the hardware stop")
    for pid in (stops, loop):
        os.kill(pid, signal.SIGCONT)


@pytest.mark.timeout(200)
def test_a_killed_loop_is_recovered_from_the_page_with_a_consent_for_each_act(
    page: Page, service: tuple["subprocess.Popen[str]", str], bench: ServedBench
) -> None:
    state(page, "idle")
    page.select_option("#protocol", "slow")
    page.click("text=Start capture")
    pressed(bench)
    (loop,) = children(service[0].pid, "controller.loop.process")
    os.kill(loop, signal.SIGKILL)
    state(page, "disconnected")
    page.click("#recover")
    for _ in range(2):
        expect(page.locator("#recovery")).to_be_visible()
        assert bench.control.number("tip.force_N") > 0.5
        page.click("text=Yes, do it")
    expect(page.locator("#message")).to_contain_text("recovered: ")
    freed(bench)
    state(page, "idle")
