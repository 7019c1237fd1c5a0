"""Pictures of the force loop: a run over time, its open loop over frequency, gain choices side by side."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.report.drawing import dress, new_figure, speed_colors, thinned
from rig.report.ink import ACTUAL, INK, MODEL, OTHER, QUIET, SMALL_PT
from rig.tissue.laws import FloatArray

POINTS = 1200
CHOICE_COLORS = {"tangent": ACTUAL, "secant": "#56b4e9", "constant": OTHER, "admittance": MODEL}


class Signals(NamedTuple):
    """A run in contact, each of shape (n,)."""

    time_s: FloatArray
    reference_N: FloatArray
    force_N: FloatArray
    depth_mm: FloatArray
    current_A: FloatArray
    voltage_V: FloatArray


def run_figure(signals: Signals, title: str) -> Figure:
    """Force against reference, displacement, effort, one above the other."""
    figure = new_figure(8.0, 6.4)
    force, depth, effort = figure.subplots(3, 1, sharex=True, height_ratios=(1.6, 1, 1))
    dress(force, title, "", "force, N")
    force.plot(*thinned(signals.time_s, signals.reference_N, POINTS), color=OTHER, linewidth=1.6, label="reference")
    force.plot(*thinned(signals.time_s, signals.force_N, POINTS), color=ACTUAL, linewidth=1.1, label="force")
    _key(force)
    dress(depth, "Displacement", "", "depth, mm")
    depth.plot(*thinned(signals.time_s, signals.depth_mm, POINTS), color=ACTUAL, linewidth=1.1)
    dress(effort, "Effort", "time, s", "voltage, V; current, A")
    effort.plot(*thinned(signals.time_s, signals.voltage_V, POINTS), color=MODEL, linewidth=0.8, label="voltage")
    effort.plot(*thinned(signals.time_s, signals.current_A, POINTS), color=INK, linewidth=0.8, label="current")
    _key(effort)
    return figure


def bode_figure(curves: Mapping[str, tuple[FloatArray, FloatArray, FloatArray]]) -> Figure:
    """Open loops by name as (frequency Hz, gain, phase deg): gain and phase over frequency."""
    figure = new_figure(8.0, 5.4)
    gain, phase = figure.subplots(2, 1, sharex=True)
    dress(gain, "Open loop at several forces", "", "gain")
    dress(phase, "", "frequency, Hz", "phase, deg")
    for (name, (frequency, size, angle)), color in zip(curves.items(), speed_colors(len(curves)), strict=True):
        gain.loglog(frequency, size, color=color, linewidth=1.3, label=name)
        phase.semilogx(frequency, angle, color=color, linewidth=1.3)
    gain.axhline(1.0, color=QUIET, linewidth=0.8)
    phase.axhline(-180.0, color=QUIET, linewidth=0.8)
    phase.set_ylim(-360, 0)
    _key(gain)
    return figure


def comparison_figure(
    subjects: Sequence[str], overshoot: Mapping[str, Sequence[float]], settling: Mapping[str, Sequence[float]]
) -> Figure:
    """Worst overshoot [%] and settling [s] of each choice on each subject; NaN where there is none."""
    figure = new_figure(9.0, 3.8)
    left, right = figure.subplots(1, 2)
    for axes, title, unit, values in (
        (left, "Worst overshoot", "% of the jump", overshoot),
        (right, "Worst settling", "s", settling),
    ):
        dress(axes, title, "", unit)
        _bars(axes, subjects, values)
    _key(left)
    return figure


def _bars(axes: Axes, subjects: Sequence[str], values: Mapping[str, Sequence[float]]) -> None:
    width = 0.8 / max(len(values), 1)
    for number, (choice, heights) in enumerate(values.items()):
        at = np.arange(len(subjects)) + (number - (len(values) - 1) / 2) * width
        axes.bar(at, heights, width, color=CHOICE_COLORS[choice], label=choice)
    axes.set_xticks(np.arange(len(subjects)), subjects, fontsize=SMALL_PT)


def _key(axes: Axes) -> None:
    axes.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK)
