"""The page in a browser without a service: its files as they are with what is added, on views of the bench."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Page, Request, Route, sync_playwright

from api.http.models import ControlView, RigView
from tests.system.browser import find, launch

FOLDER = Path(__file__).parents[1] / "api" / "http" / "page"
ADDRESS = "http://bench.invalid/"
KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
IDLE = RigView(
    state="idle", reason="", ready=True, mode="idle", time_ns=0, force_N=None, reference_N=None, position_mm=None,
    depth_mm=None, missed=0, cycles=0, rates_Hz={}, health={}, lost={}, devices={}, limits={}, job=None,
    control=ControlView(holder="", since="", left_s=0.0),
)  # fmt: skip


@contextmanager
def shown(view: RigView, added: Mapping[str, str]) -> Iterator[Page]:
    """The page as it shows ``view``; ``added`` is put where its files say `<!-- add here -->` or at their end."""

    def answer(route: Route, request: Request) -> None:
        path = request.url.removeprefix(ADDRESS)
        file = FOLDER / (path.removeprefix("page/") or "index.html")
        if path == "api/v1/live":
            route.fulfill(content_type="text/event-stream", body=f"data: {view.model_dump_json()}\n\n")
        elif path.startswith("api/"):
            route.fulfill(content_type="application/json", body=json.dumps([]))
        else:
            route.fulfill(content_type=KINDS[file.suffix], body=with_added(file, added))

    with sync_playwright() as playwright:
        browser = launch(playwright, find())
        page = browser.new_page()
        page.on("pageerror", lambda error: errors.append(str(error)))
        errors: list[str] = []
        page.route("**/*", answer)
        page.goto(ADDRESS)
        page.wait_for_function("state => document.getElementById('state').textContent === state", arg=view.state)
        yield page
        browser.close()
        assert not errors, errors


def with_added(file: Path, added: Mapping[str, str]) -> str:
    """The file's text with the block of its language."""
    text, more = file.read_text(), added.get(file.suffix[1:], "")
    if file.name == "index.html":
        return text.replace("</main>", f"{more}</main>")
    return f"{text}\n{more}" if file.name in ("page.js", "style.css") else text
