"""``python -m tools.offline FOLDER``: fails where a page of a built site would load anything from another host.

A link that a reader follows may lead anywhere; what a browser fetches by itself to show a page may not.
"""

import re
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

FETCHED = {
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
    "audio": "src",
    "embed": "src",
    "object": "data",
    "input": "src",
    "use": "href",
    "image": "href",
}
# Of all that a <link> can say, these make a browser fetch it.
FETCHED_RELATIONS = {"stylesheet", "icon", "preload", "modulepreload", "prefetch", "preconnect", "manifest"}
ELSEWHERE = re.compile(r"^\s*(?:https?:)?//", re.IGNORECASE)
STYLE = re.compile(r"""(?:@import\s+|url\(\s*)["']?((?:https?:)?//[^"')\s]+)""", re.IGNORECASE)
# A script fetches by a call with an address in it; addresses in comments and licences fetch nothing.
SCRIPT = re.compile(
    r"""(?:fetch|import|importScripts|\.open)\s*\(\s*["'`](?:GET["'],\s*["'])?((?:https?:)?//[^"'`]+)"""
)
NOTHING = re.compile(r"(?!)")


class Page(HTMLParser):
    """What a browser fetches by itself from other hosts to show one page, in ``found``."""

    def __init__(self) -> None:
        """Nothing found yet."""
        super().__init__()
        self.found: list[str] = []
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Looks at the attributes that name something to fetch."""
        self._inside = tag
        named = dict(attrs)
        relations = set((named.get("rel") or "").split())
        attribute = "href" if tag == "link" and relations & FETCHED_RELATIONS else FETCHED.get(tag, "")
        addresses = [named.get(attribute) or "", *(named.get("srcset") or "").split(",")]
        self.found += [address.strip() for address in addresses if ELSEWHERE.match(address)]
        self.found += STYLE.findall(named.get("style") or "")

    def handle_endtag(self, _tag: str) -> None:
        """Leaves a style sheet or a script."""
        self._inside = ""

    def handle_data(self, data: str) -> None:
        """Looks into style sheets and scripts within the page."""
        self.found += {"style": STYLE, "script": SCRIPT}.get(self._inside, NOTHING).findall(data)


def fetched_elsewhere(file: Path) -> list[str]:
    """Addresses on other hosts that a browser fetches by itself for ``file``: a page, a style sheet or a script."""
    text = file.read_text(errors="replace")
    if file.suffix == ".html":
        page = Page()
        page.feed(text)
        return page.found
    return {".css": STYLE, ".js": SCRIPT, ".svg": STYLE}.get(file.suffix, NOTHING).findall(text)


def look(folder: Path) -> Iterator[str]:
    """One line for each address that a file in ``folder`` fetches from elsewhere."""
    for file in sorted(path for path in folder.rglob("*.*") if path.is_file()):
        yield from (f"{file}: loads {address}" for address in fetched_elsewhere(file))


def main() -> None:
    """Prints what is fetched from elsewhere and ends with 1 if anything is, or if there is no page at all."""
    folder = Path(sys.argv[1])
    found = list(look(folder))
    if found or not any(folder.rglob("*.html")):
        sys.exit("\n".join(found) or f"{folder} holds no page")


if __name__ == "__main__":
    main()
