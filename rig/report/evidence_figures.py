"""The pictures of evidence: what each cause tried gained at each step, and which causes imitate one another."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.diagnosis.design import ASSUMED_NATS
from rig.diagnosis.estimates import SAFE_NATS
from rig.diagnosis.noise import Array
from rig.diagnosis.search import SearchStep
from rig.report.drawing import dress, new_figure
from rig.report.ink import INK, MODEL, OTHER, QUIET, SMALL_PT

BARS = 8  # of a step: what gains less than the eighth was never near


def evidence_figure(steps: Sequence[SearchStep], named: Sequence[str]) -> Figure:
    """Held-out evidence for the causes tried at each step, with the level chance reaches once in twenty."""
    heights = [max(len(best_bars(step)), 2) for step in steps]
    figure = new_figure(9.0, 0.9 * len(steps) + 0.3 * sum(heights) + 0.4)
    panels = figure.subplots(len(steps), 1, sharex=True, squeeze=False, height_ratios=heights).ravel()
    for number, (axes, step) in enumerate(zip(panels, steps, strict=True), 1):
        draw_step(axes, step, f"Step {number}: {outcome(step, named)}")
    panels[0].set_xscale("symlog", linthresh=10)
    panels[0].set_xlim(left=0)
    panels[-1].set_xlabel("evidence on recordings left out [nats: 3 are odds of 20 to 1]; dotted: chance, 1 in 20")
    return figure


def best_bars(step: SearchStep) -> list[tuple[str, float]]:
    """The causes that gained, the best last."""
    gained = sorted(((name, gain) for name, gain in step.gains.items() if gain > 0), key=lambda item: item[1])
    return gained[-BARS:]


def outcome(step: SearchStep, named: Sequence[str]) -> str:
    """What came of a step."""
    if step.taken is None:
        return "nothing more is named"
    return f"{step.taken} is taken" + ("" if step.taken in named else ", and given up later")


def draw_step(axes: Axes, step: SearchStep, title: str) -> None:
    """Its bars, the cause that was taken in the model's colour."""
    bars = best_bars(step)
    colors = [MODEL if name == step.taken else OTHER for name, _ in bars]
    axes.barh([name for name, _ in bars], [gain for _, gain in bars], color=colors, height=0.7)
    axes.axvline(step.level, color=INK, linestyle=":", linewidth=1.2)
    dress(axes, title, "", "")
    if not bars:
        axes.set_yticks([])
        axes.text(0.5, 0.5, "no cause gains anything", ha="center", transform=axes.transAxes, color=QUIET)


def confusability_figure(names: Sequence[str], left: Array) -> Figure:
    """What is left of 50 nats for each cause (row) once another (column) imitates it; numbers where below 20."""
    size = 1.6 + 0.36 * max(len(names), 3)
    figure = new_figure(size + 1.2, size)
    axes = figure.subplots()
    picture = axes.imshow(left, cmap="Blues", vmin=0, vmax=ASSUMED_NATS)
    for row, column in zip(*np.nonzero(left < SAFE_NATS), strict=True):
        axes.text(column, row, f"{left[row, column]:.0f}", ha="center", va="center", fontsize=SMALL_PT, color=MODEL)
    places = range(len(names))
    axes.set_xticks(places, names, rotation=90)
    axes.set_yticks(places, names)
    dress(axes, "Evidence left when another cause imitates it", "imitating cause", "true cause")
    axes.grid(visible=False)
    bar = figure.colorbar(picture, ax=axes, shrink=0.8)
    bar.set_label(f"nats of {ASSUMED_NATS:g}")
    return figure
