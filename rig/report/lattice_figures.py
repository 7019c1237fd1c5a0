"""Pictures of the lattice: k per force with the index curve, and force against displacement."""

from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.report.drawing import dress, label, new_figure
from rig.report.ink import ACTUAL, MODEL, OTHER, QUIET
from rig.tissue.lattice_study import LatticeStudy
from rig.tissue.study import Study, rows

Side = Literal["below right", "above"]


def lattice_figure(study: Study, found: LatticeStudy) -> Figure:
    """The study's figures 6 and 7: simulated against measured displacement, and k against displacement."""
    figure = new_figure(11.0, 4.7)
    left, right = figure.subplots(1, 2)
    _displacement(left, study, found)
    _stiffness(right, found)
    return figure


def _displacement(axes: Axes, study: Study, found: LatticeStudy) -> None:
    dress(axes, "Lattice against measurement", "displacement from contact, mm", "force, N")
    table = rows(study.judged[study.closest].fitted)
    measured = np.array([row.measured_mm for row in table])
    spread = np.array([row.measured_spread_mm for row in table])
    force = np.array([row.force_N for row in table])
    axes.errorbar(measured, force, xerr=spread, fmt="o", color=ACTUAL, markersize=4, linewidth=1.0)
    label(axes, (float(measured[-1]), float(force[-1])), "measured", ACTUAL, beside="left")
    depth = np.linspace(1e-9, float(measured[-1]), 120)
    speed = float(np.median([curve.speed_mm_s for curve in study.curves]))
    places: tuple[tuple[str, str, int, Side], ...] = (
        ("lattice index", MODEL, 80, "below right"),
        ("lattice constant", OTHER, 45, "above"),
    )
    for name, color, at, beside in places:
        judged = found.judged[name]
        shift = float(np.mean(judged.fit.offsets_mm - study.origins_mm))
        curve = judged.law.force(depth - shift, speed)
        axes.plot(depth, curve, color=color, linewidth=2.0)
        label(axes, (float(depth[at]), float(curve[at])), name, color, beside=beside)


def _stiffness(axes: Axes, found: LatticeStudy) -> None:
    dress(axes, "Spring stiffness per force", "displacement, mm", "k, N/mm")
    x = np.array([point.depth_mm for point in found.points])
    axes.plot(x, [point.k_exact_N_mm for point in found.points], "o", color=ACTUAL, markersize=7, fillstyle="none")
    searched = [(p.depth_mm, p.k_loop_N_mm) for p in found.points if p.k_loop_N_mm is not None]
    if searched:
        axes.plot(*zip(*searched, strict=True), "x", color=QUIET, markersize=5)
    line = np.linspace(0.0, float(x[-1]), 100)
    fit = found.index
    axes.plot(line, fit(line), color=MODEL, linewidth=2.0)
    formula = f"k = {fit.a_N_mm:.3g} exp({fit.b_per_mm:.3g} x),  R² {fit.r_squared:.3f}"
    text = formula + "\no  F/φ(d)    x  simulate, compare, adjust"
    axes.annotate(text, (0.03, 0.95), xycoords="axes fraction", va="top", fontsize=9, color=QUIET)
    axes.set_ylim(bottom=0.0)
