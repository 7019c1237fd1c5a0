"""Signing in where answers are lost: the page's own module on Node, with every answer in the test's hand."""

import json
from pathlib import Path
from typing import Any

import pytest

from hatch_build import LIMIT_S, SOURCES, fetch, node

ME: dict[str, Any] = {"name": "ann", "scopes": ["read"]}
LOST, WRONG, USED = None, [401, {"code": "no-credential"}], [401, {"code": "ticket", "detail": "used up"}]
BUSY, AWAY, IN = [429, {"detail": "too many"}], [502, {"detail": "no service behind the proxy"}], [200, ME]
GET_ME, TICKET = "GET /api/v1/auth/me", "POST /api/v1/auth/ticket"
HANGS = [0, "answers after a while"]
# What a browser has, as far as signing in goes. The wait before another try is over at once and the one for an answer
# soon, before one that hangs comes; what is told when either begins and when the latter ends is kept.
BROWSER = """
const [answers, hash] = JSON.parse(process.argv[2]);
const told = { asked: [], waited_ms: [], said: [], hung: [], begun: 0 };
const later = setTimeout;
Object.assign(globalThis, {
  told, addEventListener() {}, location: { hash, pathname: "/", reload() {} }, history: { replaceState() { location.hash = ""; } },
  setTimeout(then, wait_ms) {
    if (wait_ms === 3000) return later(() => (then(), told.hung.push(told.refusal())), 100);
    told.waited_ms.push(wait_ms);
    told.said.push(told.refusal());
    return later(then, 0);
  },
  async fetch(path, { method }) {
    told.asked.push(`${method} ${path}`);
    const answer = answers.shift();
    if (!answer) throw new TypeError("lost");
    if (!answer[0]) {
      await new Promise((then) => later(then, 300));
      answer.splice(0, 2, ...answers.shift());
    }
    return new Response(JSON.stringify(answer[1]), { status: answer[0] });
  },
});
process.on("exit", () => console.log(JSON.stringify({ ...told, refusal: told.refusal(), me: told.me(), hash: location.hash })));
"""  # noqa: E501 - a program of another language
PROGRAM = """
import "./browser.js";
import { me, refusal, signIn } from "%s/src/session";
Object.assign(told, { refusal: () => refusal.value, me: () => me.value });
void signIn(() => void (told.begun += 1));
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Everything in one file that Node runs."""
    folder = tmp_path_factory.mktemp("page")
    fetch(SOURCES, LIMIT_S)
    (folder / "browser.js").write_text(BROWSER)
    (folder / "entry.js").write_text(PROGRAM % SOURCES)
    made = folder / "made.mjs"
    node(["node_modules/rolldown/bin/cli.mjs", str(folder / "entry.js"), "--file", str(made)], SOURCES, LIMIT_S)
    return made


def signed_in(program: Path, answers: list[Any], address: str = "") -> dict[str, Any]:
    """What is asked, in order, and how it ends, where these answers come and no more."""
    found: dict[str, Any] = json.loads(node([str(program), json.dumps([answers, address])], program.parent, LIMIT_S))
    return found


@pytest.mark.parametrize("first", [[LOST], [LOST, LOST, LOST], [AWAY, LOST], [BUSY]])
def test_a_page_that_is_opened_before_the_service_answers_is_let_in_once_it_does(
    program: Path, first: list[Any]
) -> None:
    found = signed_in(program, [*first, IN])
    assert found["asked"] == [GET_ME] * (len(first) + 1)
    assert (found["me"], found["begun"], found["refusal"]) == (ME, 1, "")
    assert found["waited_ms"] == [1000] * len(first) and all(found["said"])


@pytest.mark.parametrize("address", ["", "#ticket=once"])
def test_a_service_that_hangs_is_told_and_its_answer_waited_for_and_asked_for_once(program: Path, address: str) -> None:
    found = signed_in(program, [HANGS, IN], address)
    assert (found["asked"], found["hung"]) == ([TICKET if address else GET_ME], ["the service does not answer"])
    assert (found["me"], found["begun"], found["refusal"]) == (ME, 1, "")


def test_whoever_waited_and_is_not_signed_in_is_told_how_to_be_and_asked_no_more(program: Path) -> None:
    found = signed_in(program, [LOST, WRONG])
    assert (found["asked"], found["said"]) == ([GET_ME] * 2, ["the service does not answer"])
    assert (found["me"], found["begun"], found["refusal"]) == (None, 0, "")


@pytest.mark.parametrize(
    ("answers", "asked"),
    [
        ([IN], [TICKET]),
        ([LOST, LOST, IN], [TICKET, GET_ME, TICKET]),
        ([LOST, WRONG, IN], [TICKET, GET_ME, TICKET]),
        # This browser is signed in since the address was opened first.
        ([USED, LOST, USED, IN], [TICKET, GET_ME, TICKET, GET_ME]),
    ],
)
def test_a_link_signs_in_also_where_an_answer_to_it_was_lost_and_stays_in_no_address(
    program: Path, answers: list[Any], asked: list[str]
) -> None:
    found = signed_in(program, answers, "#ticket=once")
    assert (found["asked"], found["me"], found["begun"], found["hash"]) == (asked, ME, 1, "")


def test_a_link_that_is_used_up_is_told_and_asked_no_more(program: Path) -> None:
    found = signed_in(program, [LOST, WRONG, USED, WRONG], "#ticket=once")
    assert found["asked"] == [TICKET, GET_ME, TICKET, GET_ME]
    assert (found["me"], found["begun"], found["refusal"]) == (None, 0, "used up")
