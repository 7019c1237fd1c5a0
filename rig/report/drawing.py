"""What all figures share: size, ink, colours that colour-blind people tell apart, and how a figure becomes bytes."""

import io
import re
from collections.abc import Iterable
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rig.recording.files import whole_file, write_text
from rig.tissue.laws import FloatArray

INK, QUIET, GRID, PAPER = "#1d2430", "#5f6b7a", "#d9dee5", "#ffffff"
# Vermilion and blue of Okabe and Ito, "Color Universal Design"; speeds go from light to dark.
MODEL, OTHER, ACTUAL = "#d55e00", "#767f8b", "#0072b2"
SPEEDS = ("#7cc4ea", "#4da6dc", "#2f86c6", "#2767a8", "#203f7d")
# Names of the page's own colours, which differ between light and dark.
THEME = {INK: "--ink", QUIET: "--quiet", GRID: "--grid", PAPER: "--paper", OTHER: "--other", ACTUAL: "--actual"} | {
    color: f"--speed-{number}" for number, color in enumerate(SPEEDS, 1)
}
SIZE_PT, SMALL_PT = 10, 8.5


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that arranges itself; no state is shared with other figures."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained", facecolor=PAPER)
    FigureCanvasAgg(figure)
    return figure


def dress(axes: Axes, title: str, xlabel: str, ylabel: str) -> None:
    """Quiet frame, a title that says what is seen, units on the axes."""
    axes.set_title(title, loc="left", fontsize=SIZE_PT + 1, color=INK, fontweight="bold", pad=10)
    axes.set_xlabel(xlabel, fontsize=SIZE_PT, color=QUIET)
    axes.set_ylabel(ylabel, fontsize=SIZE_PT, color=QUIET)
    axes.set_facecolor("none")
    axes.tick_params(colors=QUIET, labelsize=SMALL_PT, length=0)
    axes.grid(True, color=GRID, linewidth=0.7)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side == "bottom")
        spine.set_color(QUIET)


def label(
    axes: Axes,
    point: tuple[float, float],
    text: str,
    color: str,
    *,
    beside: Literal["right", "left", "above", "below", "above right", "below right"] = "right",
) -> None:
    """A direct label a few points beside a point in data coordinates."""
    dx = -8 if "left" in beside else 8 if "right" in beside else 0
    dy = 7 if "above" in beside else -7 if "below" in beside else 0
    axes.annotate(
        text,
        point,
        xytext=(dx, dy),
        textcoords="offset points",
        ha="left" if dx > 0 else "right" if dx < 0 else "center",
        va="bottom" if dy > 0 else "top" if dy < 0 else "center",
        fontsize=SMALL_PT + 0.5,
        fontweight="bold",
        color=color,
    )


def speed_colors(count: int) -> list[str]:
    """Light to dark blue, slow to fast."""
    return (
        [SPEEDS[round(position)] for position in np.linspace(0, len(SPEEDS) - 1, count)] if count > 1 else [SPEEDS[2]]
    )


def thinned(x: FloatArray, y: FloatArray, points: int = 160) -> tuple[FloatArray, FloatArray]:
    """At most ``points`` points that look the same: smallest and largest y of each run of samples, in order."""
    if len(x) <= points:
        return x, y
    edges = np.linspace(0, len(x), points // 2 + 1).astype(int).tolist()
    kept: list[int] = []
    for start, stop in pairwise(edges):
        part = y[start:stop]
        kept += sorted({start + int(np.argmin(part)), start + int(np.argmax(part))})
    return x[kept], y[kept]


def png(figure: Figure, dpi: int = 160) -> bytes:
    """The figure as PNG."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=dpi)
    return out.getvalue()


def svg(figure: Figure) -> str:
    """The figure as a stand-alone SVG file; text is drawn as paths, so it needs no font."""
    out = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "path", "svg.hashsalt": "tissue-rig"}):
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    return out.getvalue()


def save_figure(figure: Figure, folder: Path, name: str) -> None:
    """Writes NAME.png and NAME.svg in ``folder``."""
    with whole_file(folder / f"{name}.png", overwrite=True) as scratch:
        scratch.write_bytes(png(figure))
    write_text(folder / f"{name}.svg", svg(figure))


def saved_figures(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Those that ``save_figure`` left in ``folder``, as SVG by name."""
    drawn = {name: folder / f"{name}.svg" for name in names}
    return {name: path.read_text() for name, path in drawn.items() if path.exists()}


def inline_svg(figure: Figure, name: str, alt: str) -> str:
    """The figure as an SVG element of a page: described by ``alt``, own ids, ink and paper of the page's theme."""
    return inlined(svg(figure), name, alt)


def inlined(text: str, name: str, alt: str) -> str:
    """The same of a figure that was saved by ``svg``."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    for found, prefixed in ((r'\bid="', f'id="{name}-'), (r'href="#', f'href="#{name}-'), (r"url\(#", f"url(#{name}-")):
        text = re.sub(found, prefixed, text)
    for color, variable in THEME.items():
        text = text.replace(color, f"var({variable}, {color})")
    text = re.sub(r'(<svg [^>]*?) (?:width|height)="[^"]*"', r"\1", text)
    return text.replace("<svg ", f'<svg role="img" aria-label="{escape(alt)}" ', 1)
