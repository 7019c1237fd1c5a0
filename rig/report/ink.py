"""What all pictures share, whatever draws them: colours that colour-blind people tell apart and sizes."""

import re
from collections.abc import Iterable
from html import escape
from pathlib import Path

INK, QUIET, GRID, PAPER = "#1d2430", "#5f6b7a", "#d9dee5", "#ffffff"
# Vermilion and blue of Okabe and Ito, "Color Universal Design"; speeds go from light to dark.
MODEL, OTHER, ACTUAL = "#d55e00", "#767f8b", "#0072b2"
SPEEDS = ("#7cc4ea", "#4da6dc", "#2f86c6", "#2767a8", "#203f7d")
# Names of the page's own colours, which differ between light and dark.
THEME = {INK: "--ink", QUIET: "--quiet", GRID: "--grid", PAPER: "--paper", OTHER: "--other", ACTUAL: "--actual"} | {
    color: f"--speed-{number}" for number, color in enumerate(SPEEDS, 1)
}
SIZE_PT, SMALL_PT = 10, 8.5


def saved_figures(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Those of the pictures that were saved in ``folder``, as SVG by name."""
    drawn = {name: folder / f"{name}.svg" for name in names}
    return {name: path.read_text() for name, path in drawn.items() if path.exists()}


def inlined(text: str, name: str, alt: str) -> str:
    """An SVG file as an element of a page: described by ``alt``, own ids, ink and paper of the page's theme."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    for found, prefixed in ((r'\bid="', f'id="{name}-'), (r'href="#', f'href="#{name}-'), (r"url\(#", f"url(#{name}-")):
        text = re.sub(found, prefixed, text)
    for color, variable in THEME.items():
        text = text.replace(color, f"var({variable}, {color})")
    text = re.sub(r'(<svg [^>]*?) (?:width|height)="[^"]*"', r"\1", text)
    return text.replace("<svg ", f'<svg role="img" aria-label="{escape(alt)}" ', 1)
