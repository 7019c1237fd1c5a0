"""The pictures of a diagnosis: measured against simulated, what the error depends on, before and after, evidence."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.design import ASSUMED_NATS, SAFE_NATS, confusability
from rig.diagnosis.fit import Fit, least_squares
from rig.diagnosis.lack_of_fit import variables
from rig.diagnosis.search import Search
from rig.report.drawing import ACTUAL, INK, MODEL, OTHER, QUIET, SIZE_PT, SMALL_PT, dress, new_figure, thinned
from rig.simulation.drive import Array

BINS = 40  # with 375 of a session's 15,000 rows in each, a mean has a twentieth of a row's noise
SHOWN = 6
CLEAR = 0.05  # one in twenty, as the line of chance in the picture of evidence


def pictures(result: Diagnosis) -> dict[str, Figure]:
    """Figures by name; none where nothing could be tested."""
    if result.search is None or result.before is None or result.after is None:
        return {}
    before, after = least_squares(result.search.before), least_squares(result.search.after)
    return {
        "simulation": simulation_figure(before, after),
        "residuals": residual_figure(before, after, result),
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
    known = before.problem.variables()
    time = known.get("time in recording", known["session time"])[rows]
    measured = channel.observed[rows]
    above.plot(*thinned(time, measured, 600), color=ACTUAL, linewidth=2.2, label="measured")
    for fit, color, name in ((before, OTHER, "simulated before"), (after, MODEL, "extended")):
        simulated = measured - fit.residual[rows]
        above.plot(*thinned(time, simulated, 600), color=color, linewidth=1.1, label=name)
        below.plot(*thinned(time, fit.residual[rows], 600), color=color, linewidth=1.0)
    above.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK)
    dress(above, "The recording the simulation gets most wrong", "", f"{channel.name} [{channel.unit}]")
    dress(below, "Residual: grey before, orange after", "time [s]", f"measured - simulated [{channel.unit}]")
    return figure


def residual_figure(old: Fit, new: Fit, result: Diagnosis) -> Figure:
    """The error against each variable, those that tell most first and the offending ones marked."""
    assert result.before is not None and result.after is not None
    marks = offending(result)
    names = list(dict.fromkeys([*marks, *result.before.ranked]))[:SHOWN]
    figure = new_figure(10.0, 5.8)
    figure.suptitle("Mean error over each variable: grey before, orange after", fontsize=SIZE_PT, color=QUIET)
    panels = np.atleast_1d(figure.subplots(2, 3)).ravel()
    known, channel = variables(old), old.problem.channels[0]
    for axes, name in zip(panels, names, strict=False):
        values = known[name] - (new.values.get("surface_mm", 0.0) if name == "depth" else 0.0)
        for fit, color in ((old, OTHER), (new, MODEL)):
            axes.plot(*binned(values, fit.residual), color=color, linewidth=1.5)
        gains = f"{max(result.before.gains[name], 0):.0f} -> {max(result.after.gains[name], 0):.0f} nats"
        unit = old.problem.units.get(name, channel.unit)
        dress(axes, f"{name}{marks.get(name, '')}", f"{name} [{unit}]; {gains}", f"error [{channel.unit}]")
    for axes in panels[len(names) :]:
        axes.set_visible(False)
    return figure


def offending(result: Diagnosis) -> dict[str, str]:
    """The variables to be marked, each with its words: what the error still depends on, or what a cause took away."""
    if result.before is None or result.after is None:
        return {}
    if result.depends_on:
        return {name: "  <- still depends on it" for name in result.depends_on if name in result.before.gains}
    first = result.before.ranked[0]
    taken = result.after.gains[first] < 0.5 * result.before.gains[first]
    seen = bool(result.findings) and result.before.p_value < CLEAR and taken
    return {first: "  <- depended on it"} if seen else {}


def binned(values: Array, error: Array) -> tuple[Array, Array]:
    """Means of both over bins of equally many samples, shape (bins,)."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))
    place = np.clip(np.digitize(values, edges) - 1, 0, max(len(edges) - 2, 0))
    count = np.bincount(place)
    held = count > 0
    means = (np.bincount(place, column)[held] / count[held] for column in (values, error))
    return next(means), next(means)


def evidence_figure(search: Search) -> Figure:
    """Held-out evidence for each cause tried first, with the level chance reaches once in twenty."""
    figure = new_figure(7.5, 0.7 + 0.34 * max(len(search.bars), 3))
    axes = figure.subplots()
    bars = sorted(search.bars.items(), key=lambda item: item[1])
    names = [name for name, _ in bars]
    colors = [MODEL if name in search.after.names else OTHER for name in names]
    axes.barh(names, [max(gain, 0.0) for _, gain in bars], color=colors)
    if not bars:
        axes.text(0.5, 0.5, "no cause gained more than chance does", ha="center", transform=axes.transAxes, color=QUIET)
        axes.set_yticks([])
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
