"""The pictures of the report: curves and models, residuals, force tracking, the loop's timing."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from rig.report.drawing import dress, label, new_figure, speed_colors, thinned
from rig.report.ink import ACTUAL, INK, MODEL, OTHER, QUIET, SMALL_PT
from rig.tissue.fitting import residual_force
from rig.tissue.judging import Errors, Judged
from rig.tissue.laws import FloatArray
from rig.tissue.study import Study, rows

Dashes = str | tuple[float, tuple[float, ...]]
Look = tuple[str, Dashes]

LOOKS: dict[str, Look] = {"index": (MODEL, "-"), "constant": (OTHER, (0, (5, 2)))}
OTHER_COLORS = ("#009e73", "#cc79a7", "#e69f00", "#56b4e9")
OTHER_STYLES: tuple[Dashes, ...] = ((0, (1, 1.5)), (0, (6, 2, 1, 2)))
PANELS_A_ROW = 3  # 3.7 of 11 inches each: square at the height of 3.6
MOST_LABELS = 4  # laws that follow the data end side by side: more than four names there overlap


def look(name: str, study: Study) -> Look:
    """Colour and dashes of a law: the study's two have their own, the others take turns."""
    others = [law for law in study.judged if law not in LOOKS]
    if name in LOOKS:
        return LOOKS[name]
    place = others.index(name)
    return OTHER_COLORS[place % len(OTHER_COLORS)], OTHER_STYLES[place // len(OTHER_COLORS) % len(OTHER_STYLES)]


def fit_figure(study: Study) -> Figure:
    """Force against displacement at each speed with the models through it; beside it how wrong each model is."""
    figure = new_figure(11.0, 4.7)
    left, right = figure.subplots(1, 2, width_ratios=(1.45, 1))
    _curves(left, study)
    _errors(right, study)
    return figure


def _curves(axes: Axes, study: Study) -> None:
    dress(axes, "Force against displacement", "displacement from contact, mm", "force, N")
    speeds = [speed.speed_mm_s for speed in study.speeds]
    colors = dict(zip(speeds, speed_colors(len(speeds)), strict=True))
    for curve, origin_mm in zip(study.curves, study.origins_mm, strict=True):
        depth, force = thinned(curve.depth_mm - origin_mm, curve.force_N)
        axes.plot(depth, force, color=colors[curve.speed_mm_s], linewidth=0.9, alpha=0.75)
    deepest_mm = max(speed.max_depth_mm for speed in study.speeds)
    highest_N = max(speed.max_force_N for speed in study.speeds)
    for name, judged in study.judged.items():
        end = _model_line(axes, look(name, study), judged, deepest_mm, (speeds[0], speeds[-1]))
        if len(study.judged) <= MOST_LABELS:
            label(axes, end, name, look(name, study)[0])
    _speed_key(axes, colors)
    axes.set_xlim(-0.06 * deepest_mm, deepest_mm * 1.16)
    axes.set_ylim(-0.04 * highest_N, highest_N * 1.12)


def _model_line(
    axes: Axes, drawn: Look, judged: Judged, deepest_mm: float, speeds_mm_s: tuple[float, float]
) -> tuple[float, float]:
    """Draws the law between slowest and fastest speed; where its line ends."""
    depth = np.linspace(1e-9, deepest_mm, 200)
    slow, fast = (judged.law.force(depth, speed) for speed in speeds_mm_s)
    middle = (slow + fast) / 2
    color, style = drawn
    axes.fill_between(depth, slow, fast, color=color, alpha=0.15, linewidth=0)
    axes.plot(depth, middle, color=color, linewidth=2.2, linestyle=style, zorder=5)
    return deepest_mm, float(middle[-1])


def _speed_key(axes: Axes, colors: dict[float, str]) -> None:
    for row, (speed, color) in enumerate(colors.items()):
        y = 0.93 - 0.065 * row
        axes.plot([0.03, 0.08], [y, y], color=color, linewidth=2.5, transform=axes.transAxes)
        axes.text(0.1, y, f"{speed:g} mm/s", color=INK, fontsize=SMALL_PT, va="center", transform=axes.transAxes)


def _errors(axes: Axes, study: Study) -> None:
    dress(axes, "Worst error of predicted displacement", "given force, N", "error, % of measured displacement")
    for name, judged in study.judged.items():
        color, style = look(name, study)
        x, y = _percent(judged.fitted)
        worst = int(np.argmax(y))
        told = f"{name}: {y[worst]:.3g} %"
        axes.plot(x, y, color=color, marker="o", markersize=5, linewidth=1.6, linestyle=style, label=told)
        if judged.trials_left_out:
            left_x, left_y = _percent(judged.trials_left_out)
            axes.plot(left_x, left_y, color=color, marker="o", markersize=8, fillstyle="none", linewidth=0)
        if len(study.judged) <= MOST_LABELS:
            label(axes, (x[worst], y[worst]), told, color, beside="above right")
    if len(study.judged) > MOST_LABELS:
        axes.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK, loc="upper right", bbox_to_anchor=(1.0, 0.92))
    axes.margins(x=0.08)
    axes.set_ylim(0, 1.18 * axes.get_ylim()[1])
    axes.text(
        0.98, 0.97, "filled: trials fitted\nopen: each trial left out in turn",
        color=QUIET, fontsize=SMALL_PT, ha="right", va="top", transform=axes.transAxes,
    )  # fmt: skip


def _percent(errors: Errors) -> tuple[FloatArray, FloatArray]:
    found = [(row.force_N, row.error_percent) for row in rows(errors) if row.error_percent is not None]
    x, y = zip(*found, strict=True)
    return np.array(x), np.array(y)


def residual_figure(study: Study) -> Figure:
    """What each model leaves: modelled minus measured force over displacement, one line a trial."""
    columns = min(len(study.judged), PANELS_A_ROW)
    lines = -(-len(study.judged) // columns)
    figure = new_figure(11.0, 3.6 * lines)
    panels = figure.subplots(lines, columns, sharey=True, squeeze=False).ravel()
    for axes in panels[len(study.judged) :]:
        axes.remove()
    speeds = [speed.speed_mm_s for speed in study.speeds]
    colors = dict(zip(speeds, speed_colors(len(speeds)), strict=True))
    for axes, (name, judged) in zip(panels, study.judged.items(), strict=False):
        rmse_N = judged.fitted.rmse_N
        dress(axes, f"{name}: residual {rmse_N:.3g} N rms", "displacement from contact, mm", "modelled − measured, N")
        axes.axhline(0, color=INK, linewidth=0.8)
        for curve, offset_mm in zip(study.curves, judged.fit.offsets_mm, strict=True):
            depth, residual = residual_force(judged.law, curve, float(offset_mm))
            axes.plot(depth, residual, color=colors[curve.speed_mm_s], linewidth=0.9, alpha=0.8)
    return figure


@dataclass(frozen=True)
class Tracked:
    """Columns of a force-tracking run while it was in contact, shape (n,)."""

    time_s: FloatArray
    reference_N: FloatArray
    force_N: FloatArray


def tracking_figure(run: Tracked) -> Figure:
    """Given and actual force over time, and their difference below."""
    figure = new_figure(11.0, 4.4)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
    dress(above, "Given and actual force", "", "force, N")
    time, force = thinned(run.time_s, run.force_N, 800)
    above.plot(time, force, color=ACTUAL, linewidth=1.0)
    above.plot(*thinned(run.time_s, run.reference_N, 800), color=INK, linewidth=1.3, linestyle=(0, (4, 2)))
    end_s = float(run.time_s[-1])
    label(above, (end_s, float(run.reference_N[-1])), "given", INK, beside="above right")
    label(above, (end_s, float(run.force_N[-1])), "actual", ACTUAL, beside="below right")
    dress(below, "", "time in contact, s", "error, N")
    below.axhline(0, color=QUIET, linewidth=0.8)
    below.plot(*thinned(run.time_s, run.force_N - run.reference_N, 800), color=ACTUAL, linewidth=0.9)
    above.set_xlim(-0.01 * end_s, end_s * 1.08)
    return figure


def loop_figure(wake_us: FloatArray, execution_us: FloatArray, period_us: float) -> Figure:
    """How late the loop woke and how long it worked, over all cycles, against its period."""
    figure = new_figure(11.0, 3.2)
    left, right = figure.subplots(1, 2, sharey=True)
    _histogram(left, "Wake-up after the cycle was due", wake_us, period_us)
    _histogram(right, "Work in a cycle", execution_us, period_us)
    return figure


def _histogram(axes: Axes, title: str, values_us: FloatArray, period_us: float) -> None:
    dress(axes, title, "µs", "share of cycles, %")
    values = np.maximum(values_us, 1.0)
    edges = np.geomspace(1.0, max(float(values.max()), period_us) * 1.3, 70).tolist()
    axes.hist(values, edges, weights=np.full(len(values), 100 / len(values)), color=ACTUAL, alpha=0.85)
    axes.set(xscale="log", yscale="log", ylim=(30 / len(values), 300))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
        axis.set_minor_locator(NullLocator())
    axes.axvline(period_us, color=INK, linewidth=1.2, linestyle=(0, (4, 2)))
    label(axes, (period_us, 100), "period", INK, beside="left")
    lines = [f"{name}  {value:,.0f} µs" for name, value in quantiles(values_us).items()]
    axes.text(
        0.02, 0.95, "\n".join(lines), color=QUIET, fontsize=SMALL_PT, va="top", transform=axes.transAxes
    )  # fmt: skip


def quantiles(values: FloatArray) -> dict[str, float]:
    """Median, 99 % quantile and largest, by name."""
    return {
        "median": float(np.median(values)),
        "99 %": float(np.quantile(values, 0.99)),
        "largest": float(np.max(values)),
    }
