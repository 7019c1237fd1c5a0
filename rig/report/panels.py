"""Small panels of lines as one SVG, written as text: matplotlib takes a second to load and to draw fifty of them."""

import math
from collections.abc import Iterable
from html import escape
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.report.ink import GRID, PAPER, QUIET, SMALL_PT

Values = NDArray[np.float64]
FONT = "DejaVu Sans, Verdana, Arial, sans-serif"
# Room about the least and the largest value, as a share of what lies between them.
MARGIN = 0.05
MOST_TICKS = 4
TICK_PT = SMALL_PT - 1
# Of numbers from the frame, and of a title above it.
APART_PT = 4.0


class Box(NamedTuple):
    """Where a panel's frame lies in the picture [pt], counted from its upper left corner."""

    left: float
    top: float
    width: float
    height: float


class Panel:
    """A frame with round numbers along its range of values, into which is drawn; ``parts`` are its SVG."""

    def __init__(self, box: Box, x: tuple[float, float], y: tuple[float, float], names: tuple[str, str]) -> None:
        """``names`` stand below the numbers of x, and turned beside those of y."""
        self._box, self._x, self._y = box, x, y
        foot, right = box.top + box.height, box.left + box.width
        across, down = ticks(*x), ticks(*y)
        at_x, at_y = self._across(np.array(list(across))), self._down(np.array(list(down)))
        self.parts = [f'<path d="M{at:.1f} {box.top:.1f}V{foot:.1f}" stroke="{GRID}"/>' for at in at_x]
        self.parts += [f'<path d="M{box.left:.1f} {at:.1f}H{right:.1f}" stroke="{GRID}"/>' for at in at_y]
        self.parts.append(f'<path d="M{box.left:.1f} {foot:.1f}H{right:.1f}" stroke="{QUIET}"/>')
        below = foot + APART_PT + TICK_PT
        self.parts += [words(said, (at, below), "middle") for at, said in zip(at_x, across.values(), strict=True)]
        beside = zip(at_y, down.values(), strict=True)
        self.parts += [words(said, (box.left - APART_PT, at + TICK_PT / 3), "end") for at, said in beside]
        self.parts.append(words(names[0], (box.left + box.width / 2, below + TICK_PT + APART_PT), "middle"))
        turned = f'transform="translate({box.left - 34:.1f} {box.top + box.height / 2:.1f}) rotate(-90)"'
        self.parts.append(words(names[1], (0, 0), "middle", turned))

    def line(self, x: Values, y: Values, look: str) -> None:
        """A line through values, shape (n,), those left out where one is no number."""
        places = np.column_stack([self._across(x), self._down(y)])
        known = places[np.isfinite(places).all(axis=1)]
        steps = "L".join(["%.1f %.1f"] * len(known)) % tuple(known.ravel().tolist())
        self.parts.append(f'<path d="M{steps}" fill="none" {look}/>' if steps else "")

    def dots(self, x: Values, y: Values, color: str) -> None:
        """A dot at each of the values, shape (n,)."""
        places = zip(self._across(x), self._down(y), strict=True)
        self.parts += [f'<circle cx="{right:.1f}" cy="{below:.1f}" r="1.2" fill="{color}"/>' for right, below in places]

    def band(self, start: float, stop: float, look: str) -> None:
        """A stretch of x over the whole height, a point wide at least."""
        left, right = self._across(np.array([start, stop]))
        place = f'x="{left:.1f}" y="{self._box.top:.1f}" width="{max(right - left, 1):.1f}"'
        self.parts.append(f'<rect {place} height="{self._box.height:.1f}" {look}/>')

    def _across(self, x: Values) -> Values:
        return self._box.left + (x - self._x[0]) / (self._x[1] - self._x[0]) * self._box.width

    def _down(self, y: Values) -> Values:
        return self._box.top + (self._y[1] - y) / (self._y[1] - self._y[0]) * self._box.height


def words(text: str, foot: tuple[float, float], anchor: str = "start", look: str = "") -> str:
    """A line of text whose foot stands at a place of the picture."""
    place = f'x="{foot[0]:.1f}" y="{foot[1]:.1f}" text-anchor="{anchor}"'
    return f"<text {place} {look}>{escape(text)}</text>" if text else ""


def picture(width_pt: float, height_pt: float, parts: Iterable[str]) -> str:
    """A stand-alone SVG file of ``parts``."""
    size = f'width="{width_pt:g}pt" height="{height_pt:g}pt" viewBox="0 0 {width_pt:g} {height_pt:g}"'
    look = f'font-family="{FONT}" font-size="{TICK_PT:g}" fill="{QUIET}" stroke-width="0.6"'
    paper = f'<rect width="{width_pt:g}" height="{height_pt:g}" fill="{PAPER}"/>'
    return "\n".join([f'<svg xmlns="http://www.w3.org/2000/svg" {size} {look}>', paper, *parts, "</svg>", ""])


def span(*values: Values) -> tuple[float, float]:
    """A range that holds all values with a margin; about one value as much as it is large, of none 0 to 1."""
    known = np.concatenate([one[np.isfinite(one)] for one in values])
    if not known.size:
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    room = MARGIN * (high - low) or MARGIN * abs(low) or MARGIN
    return low - room, high + room


def ticks(low: float, high: float) -> dict[float, str]:
    """At most four round values from ``low`` to ``high``, 1, 2 or 5 times a power of ten apart, and as text."""
    power = 10.0 ** math.floor(math.log10((high - low) / MOST_TICKS))
    steps = (factor * power for factor in (1, 2, 5, 10, 20))
    step = next(step for step in steps if math.floor(high / step) - math.ceil(low / step) < MOST_TICKS)
    decimals = max(0, -math.floor(math.log10(step)))
    form = f".{decimals}f" if decimals <= 4 and max(abs(low), abs(high)) < 1e5 else ".3g"
    numbers = range(math.ceil(low / step), math.floor(high / step) + 1)
    return {at * step: f"{at * step:{form}}".replace("-", "\N{MINUS SIGN}") for at in numbers}
