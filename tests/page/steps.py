"""What a person does on the page, a step a function."""

import json
from typing import Any

from playwright.sync_api import Page, expect

from mock_devices.testing.commands import PATIENCE_S, ServedBench, freed, until
from mock_devices.testing.service import ask

# As the service shows it, asked for as the page does; what does not answer within 5 s says that instead.
RIG = """async () => {
  const answer = await fetch("/api/v1/rig", { signal: AbortSignal.timeout(5000) }).catch((error) => error);
  return answer.ok ? answer.json() : { reason: `the service says ${answer.status ?? answer.message}` };
}"""
ASKED = ("state", "reason", "mode", "force_N", "position_mm", "missed", "lost", "devices", "job")


def standing(page: Page) -> dict[str, Any]:
    """What keeps the bench from going on, as the service says it."""
    return reasons(page.evaluate(RIG))


def reasons(now: dict[str, Any]) -> dict[str, Any]:
    """What tells why the bench does not go on, of all that the service says."""
    return {name: now[name] for name in ASKED if name in now}


def out(bench: ServedBench, address: str) -> None:
    """Waits until the tip is out of the tissue; fails with what the service at ``address`` says of the bench."""
    try:
        freed(bench)
    except AssertionError as error:
        error.add_note(json.dumps(reasons(ask(address, "GET", "/rig")), indent=1))
        raise


def state(page: Page, name: str, within_ms: float | None = None) -> None:
    """Waits until the page says that the bench is in state ``name``; fails with why it is in another."""
    try:
        expect(page.locator("#state")).to_have_text(name, timeout=within_ms)
    except AssertionError as error:
        error.add_note(json.dumps(standing(page), indent=1))
        raise


def press(page: Page, selector: str) -> None:
    """Clicks what can be clicked; fails with why it cannot, as the page and the service say it."""
    try:
        expect(page.locator(selector)).to_be_enabled()
    except AssertionError as error:
        why = page.locator(f"{selector}-why").all_text_contents()
        error.add_note(json.dumps({"the page says": why} | standing(page), indent=1))
        raise
    page.click(selector)


def out_or_named(page: Page, bench: ServedBench) -> None:
    """Waits until the tip is out of the tissue, or left where an immediate stop had to leave it, for a stated reason.

    Whoever only lost control does not leave it there: that stop retracts.
    """

    def over() -> bool:
        at_rest = standing(page).get("mode") == "safe"
        return bench.control.number("tip.force_N") == 0.0 or at_rest

    until(over, PATIENCE_S, "the tip out, or stopped where it is")
    if bench.control.number("tip.force_N") != 0.0:
        reason = standing(page)["reason"]
        assert reason and "not in control any more" not in reason, standing(page)


def view(page: Page, name: str) -> None:
    """Goes to a view by its link."""
    page.get_by_role("navigation").get_by_role("link", name=name, exact=True).click()


def subject(page: Page, code: str, site: str, threshold_N: float) -> None:
    """Puts somebody on the bench, on the view Run."""
    page.fill("#subject-id", code)
    page.fill("#subject-site", site)
    page.fill("#subject-threshold", f"{threshold_N:g}")
    press(page, "#subject-keep")


def start(page: Page, protocol: str, session: str = "") -> None:
    """Starts a capture on the view Run."""
    view(page, "Run")
    page.select_option("#protocol", protocol)
    if session:
        page.fill("#session", session)
    press(page, "#capture-start")
