"""Pictures of the force loop: a run over time."""

from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.report.drawing import dress, new_figure, thinned
from rig.report.ink import ACTUAL, INK, MODEL, OTHER, SMALL_PT
from rig.tissue.laws import FloatArray

POINTS = 1200


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


def _key(axes: Axes) -> None:
    axes.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK)
