"""Whether everybody can use a view: axe-core finds nothing, nothing is cut off, STOP is in sight; with pictures."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, expect

from hatch_build import LIMIT_S, SOURCES, fetch
from mock_devices.testing.commands import ROOT
from tests.page.pretend import API, Pretended

AXE = SOURCES / "node_modules" / "axe-core" / "axe.min.js"
# Pictures of what was seen, to be looked at after a run; out of what is committed.
PICTURES = Path(os.environ.get("TISSUE_RIG_PICTURES", ROOT / ".venv" / "page"))
WIDTHS = (1280, 768, 390)
# The banner of an earlier press stays: only what was asked tells one from the next.
STOP = ("POST", "estop", None)
# Of all rules this one alone depends on the scheme.
CONTRAST = ("color-contrast",)
# Numbers what the Tab key has to come to. Of radio buttons with one name it comes to the one that is chosen.
MARK = """() => {
  const kinds = "a[href], button, input, select, textarea, summary, [tabindex]";
  const reached = (one) => one.checkVisibility() && !one.disabled && one.tabIndex >= 0 && (one.type !== "radio" || one.checked);
  return [...document.querySelectorAll(kinds)].filter(reached).map((one, i) => { one.dataset.tab = i; return one.outerHTML.slice(0, 90); });
}"""  # noqa: E501 - a program of another language
# What has the focus: its number, and what keeps a person from seeing that it has. A date has stops within itself.
FOCUS = """() => {
  const one = document.activeElement, box = one.getBoundingClientRect();
  const top = Math.max(box.top, 0), bottom = Math.min(box.bottom, innerHeight);
  const seen = document.elementFromPoint(box.left + box.width / 2, (top + bottom) / 2);
  const style = getComputedStyle(one), wrong = [];
  if (bottom <= top || !seen || !(one.contains(seen) || seen.contains(one))) wrong.push("is out of sight");
  if (style.outlineStyle === "none") wrong.push("has no mark of the focus");
  return [one.dataset.tab ?? null, wrong.map((text) => `${one.outerHTML.slice(0, 90)} ${text}`)];
}"""


def violations(page: Page, rules: Sequence[str] = ()) -> list[str]:
    """What axe-core says of the page as it is shown, a line each; by all its rules, or by ``rules``."""
    if not page.evaluate("() => Boolean(window.axe)"):
        fetch(SOURCES, LIMIT_S)
        page.evaluate(AXE.read_text(encoding="utf-8"))
    asked: dict[str, Any] = {"resultTypes": ["violations"]} | ({"runOnly": list(rules)} if rules else {})
    found = page.evaluate("(asked) => axe.run(document, asked)", asked)
    return [f"{one['id']}: {one['help']}: {node['html'][:200]}" for one in found["violations"] for node in one["nodes"]]


def holds_up(page: Page, name: str, widths: Sequence[int] = WIDTHS) -> None:
    """Fails where ``page`` is not usable at a width or in a scheme; leaves pictures called ``name``."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for width in widths:
        page.emulate_media(color_scheme="light", reduced_motion="reduce")
        page.set_viewport_size({"width": width, "height": 900})
        page.evaluate("() => window.scrollTo(0, 0)")
        expect(page.locator("#estop")).to_be_in_viewport()
        wide = page.evaluate("() => document.documentElement.scrollWidth")
        assert wide <= width, f"{name}: {wide} px wide where the screen has {width}"
        page.screenshot(path=PICTURES / f"{name}-{width}.png", full_page=True)
        found = violations(page)
        assert not found, f"{name}, {width} px: {found}"
        page.emulate_media(color_scheme="dark", reduced_motion="reduce")
        found = violations(page, CONTRAST)
        assert not found, f"{name}, {width} px, dark: {found}"
        page.screenshot(path=PICTURES / f"{name}-{width}-dark.png", full_page=True)


def stops(page: Page, service: Pretended) -> None:
    """Presses STOP by the keyboard alone, as whoever cannot use a mouse does; the service has to be asked once more."""
    before = service.asked.count(STOP)
    with page.expect_response(f"**/{API}estop"):
        page.keyboard.press("Escape")
    assert service.asked.count(STOP) == before + 1
    expect(page.locator("#stop-banner")).to_be_visible()
    expect(page.locator("#stop-banner")).to_be_in_viewport()


def tabbed_through(page: Page) -> list[str]:
    """What the Tab key does not come to, or comes to unseen, until it is where it began."""
    wanted = page.evaluate(MARK)
    seen, wrong = set[int](), list[str]()
    for _ in range(2 * len(wanted) + 5):
        page.keyboard.press("Tab")
        number, found = page.evaluate(FOCUS)
        if number is None:  # the document itself, after the last
            if seen:
                break
            continue
        if int(number) in seen:
            break
        seen.add(int(number))
        wrong += found
    return wrong + [f"{text} is not reached" for number, text in enumerate(wanted) if number not in seen]
