"""The page over `rig serve`: a capture, and the stop in whatever state the service is."""

import os
import re
import signal

import pytest
from playwright.sync_api import Page, expect

from mock_devices.testing.commands import ServedBench, children, pressed
from tests.page.conftest import Served
from tests.page.steps import out, start, state, view


@pytest.mark.timeout(200)
def test_a_person_runs_a_protocol_stops_it_and_finds_the_recordings(
    page: Page, service: Served, bench: ServedBench
) -> None:
    state(page, "ready")
    view(page, "Devices")
    expect(page.locator("#devices tr")).to_have_count(3)

    start(page, "short", "first")
    state(page, "running")
    expect(page.locator("#job-text")).to_contain_text("trial_001")
    state(page, "ready")
    view(page, "Sessions")
    expect(page.locator("#recordings")).to_contain_text("first")

    expect(page.locator("#control")).to_contain_text("(this page)")
    page.click("#release")
    expect(page.locator("#control")).to_have_text("nobody is in control")

    start(page, "slow", "second")
    pressed(bench)
    view(page, "Bench")
    expect(page.locator("#depth")).not_to_have_text("--")
    page.click("#estop")
    expect(page.locator("#stop-banner")).to_contain_text("Emergency stop: confirmed by the loop: braked")
    state(page, "stopped")
    expect(page.locator("#reason")).to_contain_text("emergency stop pressed")

    expect(page.locator("#presses")).to_contain_text("Acknowledge the stop, then retract it.")
    page.click("text=Acknowledge stop")
    state(page, "tip presses")
    expect(page.locator("#stop-banner")).to_have_count(0)
    view(page, "Run")
    expect(page.locator("#presses")).to_have_text(re.compile(r"^The tip presses with \d+\.\d N\. Retract it\.$"))
    expect(page.locator("#capture-start-why")).to_have_text("The tip presses: retract it first.")
    page.click("#retract-now")
    out(bench, service.origin)
    state(page, "ready")
    expect(page.locator("#presses")).to_have_count(0)


@pytest.mark.timeout(200)
def test_the_stop_is_confirmed_with_six_more_tabs_and_a_service_that_stands_still(
    page: Page, service: Served, bench: ServedBench
) -> None:
    state(page, "ready")
    start(page, "slow")
    pressed(bench)
    for _ in range(6):  # a browser opens no more connections to one address
        page.context.new_page().goto(service.address, wait_until="commit")
    service.suspend()
    page.bring_to_front()
    view(page, "Bench")
    page.keyboard.press("Escape")
    expect(page.locator("#stop-banner")).to_contain_text("Emergency stop: confirmed by the loop: braked")
    state(page, "no answer from the service")
    expect(page.locator("#force")).to_have_text("--")
    assert bench.control.get("axis.velocity_mm_s")["axis.velocity_mm_s"] == pytest.approx(0, abs=0.5)
    expect(page.locator("#reason")).to_contain_text("STOP still works, past the service.")
    expect(page.locator("#stop-banner")).to_contain_text("what has happened since is not known here")
    service.process.kill()
    expect(page.locator("#reason")).to_contain_text("What is left is the hardware stop.")
    page.keyboard.press("Escape")
    expect(page.locator("#stop-banner")).to_contain_text("NOT CONFIRMED: use the hardware stop")


@pytest.mark.timeout(200)
def test_a_stop_that_nobody_confirms_sends_to_the_hardware_stop(page: Page, service: Served) -> None:
    process = service.process
    state(page, "ready")
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
    page: Page, service: Served, bench: ServedBench
) -> None:
    state(page, "ready")
    start(page, "slow")
    pressed(bench)
    (loop,) = children(service.process.pid, "controller.loop.process")
    os.kill(loop, signal.SIGKILL)
    state(page, "disconnected")
    page.click("#recover")
    for _ in range(2):
        expect(page.locator("#recovery")).to_be_visible()
        assert bench.control.number("tip.force_N") > 0.5
        page.click("text=Yes, do it")
    expect(page.locator("#message")).to_contain_text("recovered: ")
    out(bench, service.origin)
    state(page, "ready")
