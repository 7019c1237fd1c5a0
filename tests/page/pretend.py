"""The page over a service that only pretends: every answer is in the test's hand, in the form the models give it."""

import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, Request, Route
from pydantic import BaseModel

from api.http.models import ControlView, RigView
from hatch_build import SOURCES, built_folder
from tests.page import told

ADDRESS = "http://bench.invalid/"
KIND = re.compile(r"kind=([a-z-]+)")
CURSOR = re.compile(r"cursor=([^&]+)")
KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
API = "api/v1/"
# A stream that greets, sends half a minute of pressing with a force that follows a set-point, and goes on with it ten
# times a second; `hung` silences it, `still` leaves out the samples; a `dead` one is silent for good and never closed.
SOCKET = """
window.hung = window.still = false;
const STREAMS = ["force", "setpoint", "error", "depth", "position", "marker"];
const depth = (t) => 4 + 3 * Math.sin(0.9 * t);
const setpoint = (t) => 0.12 * depth(t) * Math.exp(0.22 * depth(t));
const force = (t) => setpoint(t - 0.03) + 0.02 * Math.sin(91 * t);
const AT = {
  force: [force, force], setpoint: [setpoint, setpoint], error: [(t) => setpoint(t) - force(t), (t) => setpoint(t) - force(t)],
  depth: [depth, depth], position: [(t) => 20 + depth(t), (t) => 20 + depth(t)], marker: [depth, () => 0, () => 0],
};
window.AT = AT;
function batch(name, from_s, to_s, seq) {
  const of = AT[name], n = Math.round((to_s - from_s) * 100);
  const data = new ArrayBuffer(24 + 4 * n * (1 + of.length)), view = new DataView(data);
  view.setUint16(0, STREAMS.indexOf(name) + 1, true);
  view.setUint16(2, of.length, true);
  view.setUint32(4, seq, true);
  view.setBigInt64(8, BigInt(Math.round(from_s * 1e9)), true);
  view.setUint32(16, n, true);
  view.setUint32(20, n, true);
  for (let i = 0; i < n; i++) {
    view.setInt32(24 + 4 * i, i * 1e7, true);
    of.forEach((value, k) => view.setFloat32(24 + 4 * n * (k + 1) + 4 * i, value(from_s + i / 100), true));
  }
  return data;
}
window.WebSocket = class {
  constructor() {
    this.at = 40;
    window.socket = this;
    const hello = { type: "hello", session_id: "s", run: "r", monotonic_ns: 40e9, event_seq: 0, streams: STREAMS.map((name) => ({ name })) };
    setTimeout(() => {
      if (window.hung) return;
      this.say(hello);
      this.say({ type: "subscribed", channels: STREAMS.map((stream, i) => ({ channel: i + 1, stream, columns: [], step: 1 })) });
      for (let t = 10; t < this.at; t++) this.sample(t, t + 1);
    });
    setInterval(() => window.hung || this.dead || (this.say({ type: "ping" }), this.sample(this.at, this.at + 0.1), (this.at += 0.1)), 100);
  }
  say(message) {
    window.said_ms = performance.now();
    this.onmessage({ data: JSON.stringify(message) });
  }
  sample(from_s, to_s) {
    if (!window.still) for (const name of STREAMS) this.onmessage({ data: batch(name, from_s, to_s, Math.round(from_s * 100)) });
  }
  send() {}
  close() {}
};
"""  # noqa: E501 - a program of another language
IDLE = RigView(
    state="idle", reason="", ready=True, mode="idle", time_ns=0, force_N=0.02, reference_N=None, position_mm=4.0,
    depth_mm=None, missed=0, cycles=1000, rates_Hz={"force": 1000.0, "axis": 1000.0, "marker": 100.0},
    health={name: {"alive": True, "valid": True, "on_rate": True} for name in ("force", "axis", "marker")}, lost={},
    devices={
        role: {"product": product, "serial": "1", "firmware": "1", "settings": {}, "state": "ok", "detail": ""}
        for role, product in (("force", "bota-sensone"), ("axis", "maxon-epos4"), ("tracker", "ndi-polaris"))
    },
    limits={"force_N": 12.0, "depth_mm": 25.0, "speed_mm_s": 50.0}, job=None,
    control=ControlView(holder="", since="", left_s=0.0),
)  # fmt: skip
OPERATOR = {"name": "ann", "scopes": ["read", "operate"], "credential": "browser"}
INFO = {"stop_port": 0, "software": "tissue-rig", "service_id": "s", "monotonic_ns": 0, "sessions_folder": ""}
STOPPED = {"done": True, "mode": "safe", "detail": "braked", "id": 1}
ADMINISTRATOR = OPERATOR | {"scopes": ["read", "operate", "admin"]}
Answer = BaseModel | dict[str, Any] | list[Any] | str | None
Show = Callable[[str], Page]


@dataclass
class Pretended:
    """What is answered by path below /api/v1/; None never answers, an int refuses with that status.

    A page of a list that begins at a cursor is named by it: ``audit@c1``.
    """

    built: Path
    answers: dict[str, Answer | int] = field(default_factory=dict)
    asked: list[tuple[str, str, Any]] = field(default_factory=list)
    """Method, path and body of what changed anything."""

    def says(self, **views: Answer | int) -> None:
        """Other answers, by the path's name with / as two underscores."""
        self.answers.update({name.replace("__", "/"): answer for name, answer in views.items()})

    def answer(self, route: Route, request: Request) -> None:
        """One request."""
        path, _, query = request.url.removeprefix(ADDRESS).partition("?")
        if not path.startswith(API):
            file = self.built / (path.removeprefix("page/") or "index.html")
            return route.fulfill(content_type=KINDS.get(file.suffix, ""), body=file.read_bytes())
        if request.method != "GET":
            self.asked.append((request.method, path.removeprefix(API), request.post_data_json))
        # A list of jobs is asked for by kind: what is said of one is not said of the others.
        path = f"{path}/{kind[1]}" if path.endswith("/jobs") and (kind := KIND.search(query)) else path
        path = f"{path}@{cursor[1]}" if (cursor := CURSOR.search(query)) else path
        return self._said(route, f"{request.method} {path.removeprefix(API)}")

    def _said(self, route: Route, asked: str) -> None:
        name = asked.removeprefix("GET ")
        found = self.answers.get(name, 404)
        if found is None:
            return None
        if isinstance(found, int):
            problem = {"title": "refused", "status": found, "code": "test", "detail": f"{name} is refused here"}
            return route.fulfill(status=found, content_type="application/problem+json", body=json.dumps(problem))
        if name.endswith(".svg"):
            return route.fulfill(content_type=KINDS[".svg"], body=str(found))
        body = found.model_dump_json() if isinstance(found, BaseModel) else json.dumps(found)
        headers = {"ETag": '"1"', "Content-Type": "application/json"}
        return route.fulfill(body=body, headers=headers)


def resting(**more: Answer) -> Pretended:
    """At rest, with one session, for somebody who may operate; ``more`` is answered besides."""
    answers: dict[str, Answer | int] = {"auth/me": OPERATOR, "rig": IDLE, "info": INFO, **more}
    return Pretended(built_folder(SOURCES), answers | told.everything())


@contextmanager
def showing(browser: Browser, pretended: Pretended) -> Iterator[Show]:
    """Shows the page at a place, as often as it is asked to; at the end none may have gone wrong."""
    pages: list[Page] = []
    errors: list[str] = []

    def at(place: str) -> Page:
        pages.append(opened(browser, pretended, place, errors))
        return pages[-1]

    yield at
    for page in pages:
        page.context.close()
    assert errors == []


def opened(browser: Browser, pretended: Pretended, view: str, errors: list[str]) -> Page:
    """The page at ``view``, in a context of its own."""
    context = browser.new_context(reduced_motion="reduce")
    context.add_init_script(SOCKET)
    page = context.new_page()
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.route("**/*", pretended.answer)
    page.goto(f"{ADDRESS}#/{view}")
    return page
