"""The pictures of a diagnosis: measured against simulated, what the error depends on, before and after, evidence."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.design import ASSUMED_NATS, SAFE_NATS, confusability
from rig.diagnosis.fit import Fit, least_squares
from rig.diagnosis.omnibus import Leftover, variables
from rig.diagnosis.search import Search
from rig.report.drawing import ACTUAL, INK, MODEL, QUIET, RIVAL, SMALL_PT, dress, new_figure, thinned
from rig.simulation.drive import Array

BINS = 40
SHOWN = 6


def pictures(result: Diagnosis) -> dict[str, Figure]:
    """Figures by name; none where nothing could be tested."""
    if result.search is None or result.before is None or result.after is None:
        return {}
    before, after = least_squares(result.search.before), least_squares(result.search.after)
    return {
        "simulation": simulation_figure(before, after),
        "residuals": residual_figure(before, after, result.before, result.after),
        "evidence": evidence_figure(result.search),
        "confusability": confusability_figure(*confusability(result.search.tangents)),
    }


def simulation_figure(before: Fit, after: Fit) -> Figure:
    """One recording, measured and simulated; below it what is left, before and after the extension."""
    figure = new_figure(9.0, 5.2)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1))
    channel = before.problem.channels[0]
    worst = int(np.argmax(np.bincount(channel.recording, before.residual**2)))
    rows = channel.recording == worst
    time = before.problem.variables().get("time in recording", np.arange(len(rows), dtype=float))[rows]
    measured = channel.observed[rows]
    above.plot(*thinned(time, measured, 600), color=ACTUAL, linewidth=2.2, label="measured")
    for fit, color, name in ((before, RIVAL, "simulated before"), (after, MODEL, "extended")):
        simulated = measured - fit.residual[rows]
        above.plot(*thinned(time, simulated, 600), color=color, linewidth=1.1, label=name)
        below.plot(*thinned(time, fit.residual[rows], 600), color=color, linewidth=1.0)
    above.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK)
    dress(above, "The recording the simulation gets most wrong", "", f"{channel.name} [{channel.unit}]")
    dress(below, "What is left: grey before, red after", "time in recording [s]", f"error [{channel.unit}]")
    return figure


def residual_figure(old: Fit, new: Fit, before: Leftover, after: Leftover) -> Figure:
    """The error against each variable, the most telling ones first and marked; grey before, red after."""
    names = before.ranked[:SHOWN]
    figure = new_figure(10.0, 5.6)
    panels = np.atleast_1d(figure.subplots(2, 3)).ravel()
    known = variables(old)
    for axes, name in zip(panels, names, strict=False):
        values = known[name]
        edges = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))
        for fit, color in ((old, RIVAL), (new, MODEL)):
            place = np.clip(np.digitize(values, edges) - 1, 0, max(len(edges) - 2, 0))
            count = np.maximum(np.bincount(place), 1)
            axes.plot(
                np.bincount(place, values) / count, np.bincount(place, fit.residual) / count, color=color, linewidth=1.5
            )
        mark = "  <- depends on it" if name in names[:1] and before.p_value < 0.05 else ""
        gains = f"{max(before.gains[name], 0):.0f} -> {max(after.gains[name], 0):.0f} nats"
        dress(axes, f"{name}{mark}", gains, "mean error")
    for axes in panels[len(names) :]:
        axes.set_visible(False)
    return figure


def evidence_figure(search: Search) -> Figure:
    """Held-out evidence for each cause tried first, with the level chance reaches once in twenty."""
    figure = new_figure(7.5, 0.7 + 0.34 * max(len(search.bars), 3))
    axes = figure.subplots()
    bars = sorted(search.bars.items(), key=lambda item: item[1])
    names = [name for name, _ in bars]
    colors = [MODEL if name in search.after.names else RIVAL for name in names]
    axes.barh(names, [max(gain, 0.0) for _, gain in bars], color=colors)
    level = max((float(np.quantile(maxima, 0.95)) for maxima in search.maxima if maxima.size), default=0.0)
    axes.axvline(level, color=QUIET, linestyle=":", linewidth=1.2)
    axes.set_xscale("symlog", linthresh=10)
    dress(axes, "Evidence on recordings left out (dotted: chance, 1 in 20)", "gain [nats]", "")
    return figure


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
