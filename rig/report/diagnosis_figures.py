"""The pictures of a diagnosis: what its error is made of, measured against simulated, what the error depends on."""

from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.design import confusability
from rig.diagnosis.estimates import ErrorBudget, NamedCause
from rig.diagnosis.fit import least_squares
from rig.diagnosis.floor import JudgedErrors
from rig.diagnosis.lack_of_fit import variables
from rig.diagnosis.noise import Array, Index, Mask
from rig.report.drawing import dress, new_figure, thinned
from rig.report.evidence_figures import confusability_figure, evidence_figure
from rig.report.ink import ACTUAL, GRID, INK, MODEL, OTHER, SIZE_PT, SMALL_PT
from rig.results.diagnosis_lines import first_size, unit_after

BINS = 30  # of even width, as far as the outer permilles
FEWEST_ROWS = 10  # a bin with fewer is a spike of chance
SHOWN = 6
CLEAR = 0.05  # one in twenty, as the line of chance in the picture of evidence
POINTS = 600  # of a curve, on five hundred pixels
SURE = 2.0  # standard deviations that hold 95 %


class Compared(NamedTuple):
    """Errors before and after what was named, in ``unit``, and the rows in which they count; shape (n,)."""

    before: Array
    after: Array
    judged: Mask
    recording: Index
    unit: str

    def where_judged(self) -> "Compared":
        """The same with NaN in rows that do not count, so that lines have gaps there."""
        before, after = (np.where(self.judged, error, np.nan) for error in (self.before, self.after))
        return self._replace(before=before, after=after)


def pictures(result: Diagnosis) -> dict[str, Figure]:
    """Figures by name, those first that tell most; none where nothing could be tested."""
    if result.search is None or result.before is None or result.after is None:
        return {}
    errors = compared(result)
    share = {} if result.budget is None else {"share": share_figure(result.budget)}
    seen = {"simulation": simulation_figure(result, errors), "residuals": residual_figure(result, errors)}
    first = seen if result.findings else dict(reversed(seen.items()))
    return share | first | {
        "evidence": evidence_figure(result.search.steps, result.search.after.names),
        "confusability": confusability_figure(*confusability(result.search.tangents)),
    }  # fmt: skip


def compared(result: Diagnosis) -> Compared:
    """Errors on recordings left out; of an axis, those of the models at their least-squares best."""
    assert result.search is not None
    channel = result.search.after.problem.channels[0]
    factor, unit = plain_unit(channel.unit)
    if isinstance(result.budget, JudgedErrors):
        base, extended = result.budget.base, result.budget.extended
        return Compared(base.residual, extended.residual, extended.judged, channel.recording, unit)
    before, after = (least_squares(model) for model in (result.search.before, result.search.after))
    judged = ~after.problem.blind(after.values)
    return Compared(factor * before.residual, factor * after.residual, judged, channel.recording, unit)


def plain_unit(unit: str) -> tuple[float, str]:
    """Factor and unit of what stands for several of a unit, as "9.3 N" does in the rows of a drive axis."""
    number, _, name = unit.partition(" ")
    try:
        return float(number), name
    except ValueError:
        return 1.0, unit


def share_figure(budget: ErrorBudget) -> Figure:
    """The power of the error of the simulation as it is in one bar, by what it is made of."""
    figure = new_figure(9.0, 1.9)
    axes, begun = figure.subplots(), 0.0
    for (name, power), color in zip(power_shares(budget).items(), (GRID, OTHER, MODEL, ACTUAL), strict=True):
        axes.barh([0], [100 * power], left=100 * begun, color=color, label=f"{name} {100 * power:.0f} %")
        begun += power
    axes.set_yticks([])
    axes.set_xlim(0, 100)
    figure.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK, ncols=4, loc="outside lower center")
    error = f"{budget.base_N:.2g} N -> {budget.extended_N:.2g} N, {budget.floor_N:.2g} N could be reached"
    dress(axes, f"What the error on recordings left out is made of: {error}", "% of its power", "")
    return figure


def power_shares(budget: ErrorBudget) -> dict[str, float]:
    """Shares of the power of the error before: noise, what else differs between repeats, explained, left; sum 1."""
    error = budget.extended_N**2
    noise = min((budget.noise_N or 0.0) ** 2, error)
    repeats = min(max((budget.repeatability_N or 0.0) ** 2 - noise, 0.0), error - noise)
    explained = max(budget.base_N**2 - error, 0.0)
    left = error - noise - repeats
    parts = {"noise": noise, "differs between repeats": repeats, "explained": explained, "left": left}
    return {name: power / max(sum(parts.values()), 1e-300) for name, power in parts.items()}


def simulation_figure(result: Diagnosis, errors: Compared) -> Figure:
    """One recording, measured and simulated with the band of its errors; below it what is left, before and after."""
    figure = new_figure(9.0, 5.6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1))
    time_s, measured, name = readings(result)
    rows = errors.recording == telling_recording(errors, bool(result.findings))
    errors = errors.where_judged()
    above.plot(*thinned(time_s[rows], measured[rows], POINTS), color=ACTUAL, linewidth=2.2, label="measured")
    half = SURE * (result.budget.extended_N if result.budget else rms(errors.after[errors.judged]))
    x, y = (along[rows][:: max(1, np.count_nonzero(rows) // POINTS)] for along in (time_s, measured - errors.after))
    above.fill_between(x, y - half, y + half, color=MODEL, alpha=0.2, linewidth=0, label="95 % of its errors")
    for error, color, label in drawn(result, errors):
        above.plot(*thinned(time_s[rows], (measured - error)[rows], POINTS), color=color, linewidth=1.1, label=label)
        below.plot(*thinned(time_s[rows], error[rows], POINTS), color=color, linewidth=1.0)
    if result.budget is not None and result.budget.noise_N:
        reach = SURE * result.budget.noise_N
        below.axhspan(-reach, reach, color=GRID, linewidth=0, label="noise (95 %)")
    figure.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK, ncols=5, loc="outside lower center")
    dress(above, headline(result, errors), "", f"{name} as read, its zero in it [{errors.unit}]")
    dress(below, "Error of the simulation", "time [s]", f"measured - simulated [{errors.unit}]")
    return figure


def drawn(result: Diagnosis, errors: Compared) -> list[tuple[Array, str, str]]:
    """Errors to be drawn, each with its colour and label: one model where nothing is named, else two."""
    if not result.findings:
        return [(errors.after, MODEL, "simulated")]
    return [(errors.before, OTHER, "simulated as it was"), (errors.after, MODEL, "with what is named")]


def readings(result: Diagnosis) -> tuple[Array, Array, str]:
    """Time in the recording [s], what was read in its plain unit, and of what; shape (n,)."""
    assert result.search is not None
    problem = result.search.after.problem
    channel, known = problem.channels[0], problem.variables()
    name = "time in recording" if "time in recording" in known else "session time"
    seconds = plain_unit(problem.units[name])[0] * known[name]
    return seconds, plain_unit(channel.unit)[0] * channel.observed, channel.name


def telling_recording(errors: Compared, named: bool) -> int:
    """The recording after the first in which most was taken off, or where nothing is named, most is left.

    The first begins where homing left guide and nut, as no other does.
    """
    rows, before, after = errors.judged, errors.before**2, errors.after**2
    told = np.bincount(errors.recording[rows], (before - after if named else after)[rows])
    return int(np.argmax(told[1:])) + 1 if len(told) > 1 else 0


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def headline(result: Diagnosis, errors: Compared) -> str:
    """The causes with their sizes, and below what they take off; or what is left where none is named."""
    if not result.findings:
        left = "" if result.budget is None else f"\nerror on recordings left out {result.budget.extended_N:.2g} N"
        return f"No cause can be named{left}"
    likely = "Provisionally: " * any(finding.provisional for finding in result.findings)
    return "\n".join([likely + ",\n".join(map(sized, result.findings)), gained(result, errors)])


def sized(finding: NamedCause) -> str:
    """A cause with its size and the interval of that."""
    names = " or ".join(finding.effects).replace("_", " ")
    _, size = first_size(finding)
    return f"{names} {size.value:.3g}{unit_after(size)} ({size.low:.3g} to {size.high:.3g})" if size else names


def gained(result: Diagnosis, errors: Compared) -> str:
    """What the causes together take off the error."""
    if result.budget is None:
        before, after, where = rms(errors.before[errors.judged]), rms(errors.after[errors.judged]), ""
    else:
        before, after, where = result.budget.base_N, result.budget.extended_N, " on recordings left out"
    less = 100 * (1 - after / max(before, 1e-300))
    return f"error{where} {before:.2g} -> {after:.2g} {errors.unit}, {less:.0f} % less"


def residual_figure(result: Diagnosis, errors: Compared) -> Figure:
    """The error against each variable, those that tell most first and the offending ones marked."""
    assert result.before is not None and result.after is not None and result.search is not None
    marks = offending(result)
    names = list(dict.fromkeys([*marks, *result.before.ranked]))[:SHOWN]
    figure = new_figure(10.0, 6.0)
    what = "Mean error over each variable" if result.findings else "The shape of what is left, over each variable"
    colours = ": grey as it was, orange with what is named" * bool(result.findings)
    figure.suptitle(f"{what}{colours}; bands hold 95 %, over recordings", fontsize=SIZE_PT + 1, color=INK)
    known = variables(result.search.before)
    for axes, name in zip(figure.subplots(2, 3, sharey=True).ravel(), names, strict=False):
        factor, unit = plain_unit(result.search.after.problem.units.get(name, errors.unit))
        contact = result.search.after.values.get("surface_mm", 0.0) if name == "depth" else 0.0
        values = factor * (known[name] - contact)
        for error, color, _ in drawn(result, errors):
            rows = errors.judged
            place, mean, half = binned(values[rows], error[rows], errors.recording[rows])
            axes.fill_between(place, mean - half, mean + half, color=color, alpha=0.25, linewidth=0)
            axes.plot(place, mean, color=color, linewidth=1.4, marker=".", markersize=4)
        dress(axes, f"{name}{marks.get(name, '')}", f"{name} [{unit}]" if unit else name, f"error [{errors.unit}]")
    for axes in figure.axes[len(names) :]:
        axes.set_visible(False)
    return figure


def offending(result: Diagnosis) -> dict[str, str]:
    """The variables to be marked, each with its words: what the error still depends on, or what a cause took away."""
    if result.before is None or result.after is None:
        return {}
    if result.depends_on:
        return {name: ": still left" for name in result.depends_on if name in result.before.gains}
    first = result.before.ranked[0]
    taken = result.after.gains[first] < 0.5 * result.before.gains[first]
    seen = bool(result.findings) and result.before.p_value < CLEAR and taken
    return {first: ": taken away"} if seen else {}


def binned(values: Array, error: Array, recording: Index) -> tuple[Array, Array, Array]:
    """Means of both over even bins, and half the 95 % interval of the error's, shape (bins,).

    Samples of one recording err alike, so the interval counts recordings: that of a ratio over clusters (Cochran 1977,
    "Sampling Techniques", 6.4).
    """
    low, high = np.percentile(values, [0.1, 99.9])
    edges = np.linspace(low, high, BINS + 1)
    place = np.searchsorted(edges[1:-1], values, side="right")
    shape = int(place.max()) + 1, int(recording.max()) + 1
    cell = np.ravel_multi_index((place, recording), shape)
    count, total, along = (
        np.bincount(cell, weight, shape[0] * shape[1]).reshape(shape) for weight in (None, error, values)
    )
    filled = count.sum(axis=1) >= FEWEST_ROWS
    count, total, along = count[filled], total[filled], along[filled]
    held, units = count.sum(axis=1), np.count_nonzero(count, axis=1)
    mean = total.sum(axis=1) / held
    off = ((total - count * mean[:, None]) ** 2).sum(axis=1) * units / np.maximum(units - 1, 1)
    return along.sum(axis=1) / held, mean, SURE * np.sqrt(off) / held
