"""Another language is another file: with every text of it marked, no view shows a word of its own without the mark."""

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect
from pydantic import BaseModel

from hatch_build import LIMIT_S, SOURCES, build, built_folder, fetch
from tests.page.pretend import Pretended, opened
from tests.page.test_every_view import everything
from tests.page.views import VIEWS

MARK = "\N{CURRENCY SIGN}"
LANGUAGE = """
import { en } from "./en";
const mark = (one: unknown): unknown =>
  typeof one === "string" ? one.replace(/\\S+/g, "MARK$&")
  : typeof one === "function" ? (...given: unknown[]) => mark(one(...given))
  : Array.isArray(one) ? one.map(mark)
  : one && typeof one === "object" ? Object.fromEntries(Object.entries(one).map(([name, text]) => [name, mark(text)]))
  : one;
export const xx = { ...(mark(en) as typeof en), lang: "xx" };
""".replace("MARK", MARK)
# Everything that a person reads or a screen reader says, but for what stands there where no program runs.
SAID = """() => {
  const found = [], texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    if (!texts.currentNode.parentElement.closest("script, style, noscript")) found.push(texts.currentNode.data);
  }
  for (const one of document.querySelectorAll("*")) {
    found.push(...["aria-label", "title", "placeholder", "alt"].map((name) => one.getAttribute(name) ?? ""));
  }
  return found;
}"""
WORD = re.compile(r"[^\W\d_]{3,}")
# As this browser writes dates: their language is its own.
DATE = re.compile(r"[A-Z][a-z]{2} \d{1,2}, \d{4}")


@pytest.fixture(scope="module")
def translated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page in the language of the mark, built from the same sources."""
    fetch(SOURCES, LIMIT_S)
    sources = tmp_path_factory.mktemp("page") / "sources"
    shutil.copytree(SOURCES, sources, ignore=shutil.ignore_patterns("node_modules"))
    (sources / "node_modules").symlink_to(SOURCES / "node_modules")
    (sources / "src" / "texts" / "xx.ts").write_text(LANGUAGE, encoding="utf-8")
    (sources / "src" / "texts.ts").write_text('export { xx as t } from "./texts/xx";\n')
    build(sources)
    return built_folder(sources)


@pytest.fixture(scope="module")
def service(translated: Path) -> Pretended:
    return Pretended(translated, everything())


@pytest.fixture(scope="module")
def page(browser: Browser, service: Pretended) -> Iterator[Page]:
    errors: list[str] = []
    found = opened(browser, service, "bench", errors)
    yield found
    found.context.close()
    assert errors == []


def data(service: Pretended) -> str:
    """All that comes from the service, which speaks for itself."""
    known: list[Any] = [
        one.model_dump(mode="json") if isinstance(one, BaseModel) else one for one in service.answers.values()
    ]
    return json.dumps(known, ensure_ascii=False)


def unmarked(page: Page, service: Pretended) -> list[str]:
    """What is said by neither the language's file nor the service."""
    told = data(service)
    texts = (DATE.sub("", text).strip() for text in page.evaluate(SAID))
    return sorted({text for text in texts if MARK not in text and any(word not in told for word in WORD.findall(text))})


@pytest.mark.parametrize("view", VIEWS)
def test_no_view_has_a_word_of_its_own(page: Page, service: Pretended, view: str) -> None:
    page.evaluate("(at) => { location.hash = `#/${at}`; }", VIEWS[view][0])
    expect(page.locator(VIEWS[view][1])).to_be_visible()
    assert page.evaluate("() => document.documentElement.lang") == "xx"
    assert unmarked(page, service) == []


def test_a_word_that_stands_in_a_view_is_found(page: Page, service: Pretended) -> None:
    page.evaluate("() => { document.querySelector('main').append('Planted word'); }")
    page.evaluate("() => { document.querySelector('#estop').title = 'Planted title'; }")
    assert unmarked(page, service) == ["Planted title", "Planted word"]
