"""What figures of matplotlib share: frame, labels, and how a figure becomes bytes."""

import io
from pathlib import Path
from typing import Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rig.recording.files import whole_file, write_text
from rig.report.ink import GRID, INK, PAPER, QUIET, SIZE_PT, SMALL_PT, SPEEDS, inlined
from rig.tissue.laws import FloatArray
from rig.trials.thinning import extremes


def new_figure(width_in: float, height_in: float, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """An empty figure that arranges itself, unless ``layout`` is None; no state is shared with other figures."""
    figure = Figure(figsize=(width_in, height_in), layout=layout, facecolor=PAPER)
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
    """At most ``points`` points that look the same, in order."""
    kept = extremes(y, points)
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


def inline_svg(figure: Figure, name: str, alt: str) -> str:
    """The figure as an SVG element of a page: described by ``alt``, own ids, ink and paper of the page's theme."""
    return inlined(svg(figure), name, alt)
