"""The page in a browser without a service: its sources as they are with what is added, built, on views of the bench."""

import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Page, Request, Route, sync_playwright

from api.http.models import ControlView, RigView
from hatch_build import LIMIT_S, SOURCES, build, fetch
from mock_devices.testing.browser import launch
from tests.system.browser import find

ADDRESS = "http://bench.invalid/"
KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
IDLE = RigView(
    state="idle", reason="", ready=True, mode="idle", time_ns=0, force_N=None, reference_N=None, position_mm=None,
    depth_mm=None, missed=0, cycles=0, rates_Hz={}, health={}, lost={}, devices={}, limits={}, job=None,
    control=ControlView(holder="", since="", left_s=0.0),
)  # fmt: skip

# What the page calls a bench that it has heard of, at rest and with a tip that presses.
KNOWN = ["ready", "tip presses"]

# A stream that is open and says only that it is.
SPEAKING = """
window.WebSocket = class {
  constructor() { setInterval(() => this.onmessage?.({ data: '{"type": "ping"}' }), 100); }
  send() {}
};
"""

Changes = Mapping[str, Mapping[str, str]]


@contextmanager
def shown(views: Sequence[RigView], added: Mapping[str, str], changed: Changes) -> Iterator[list[Page]]:
    """A page for each of ``views``; ``added`` are files by their place in its sources, ``changed`` lines in others."""
    with tempfile.TemporaryDirectory() as place, sync_playwright() as playwright:
        built = built_with(added, changed, Path(place))
        browser = launch(playwright, find())
        errors: list[str] = []
        yield [_opened(browser.new_page(), built, view, errors) for view in views]
        browser.close()
        assert not errors, errors


def built_with(added: Mapping[str, str], changed: Changes, folder: Path) -> Path:
    """Where the page is, built from our sources with ``added`` and ``changed``."""
    fetch(SOURCES, LIMIT_S)
    sources = folder / "sources"
    shutil.copytree(SOURCES, sources, ignore=shutil.ignore_patterns("node_modules"))
    (sources / "node_modules").symlink_to(SOURCES / "node_modules")
    for name, text in added.items():
        (sources / name).write_text(text)
    for name, lines in changed.items():
        text = (sources / name).read_text()
        for old, new in lines.items():
            assert old in text, f"{name} has no {old!r}"
            text = text.replace(old, new)
        (sources / name).write_text(text)
    build(sources)
    return folder / "built"


def _opened(page: Page, built: Path, view: RigView, errors: list[str]) -> Page:
    """The page in ``built``, whose service says ``view`` and nothing else."""

    def answer(route: Route, request: Request) -> None:
        path = request.url.removeprefix(ADDRESS)
        if path == "api/v1/rig":
            route.fulfill(content_type="application/json", body=view.model_dump_json())
        elif path == "api/v1/auth/me":
            route.fulfill(content_type="application/json", body=json.dumps({"name": "", "scopes": ["read"]}))
        elif path.startswith("api/"):
            route.fulfill(content_type="application/json", body=json.dumps([]))
        else:
            file = built / (path.removeprefix("page/") or "index.html")
            route.fulfill(content_type=KINDS[file.suffix], body=file.read_bytes())

    page.on("pageerror", lambda error: errors.append(str(error)))
    page.add_init_script(SPEAKING)
    page.route("**/*", answer)
    page.goto(ADDRESS)
    page.wait_for_function(f"() => {json.dumps(KNOWN)}.includes(document.getElementById('state')?.textContent)")
    return page
