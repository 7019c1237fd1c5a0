"""The force law on the bench beside the same and others simulated, subject by subject."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from rig.report.drawing import dress, new_figure
from rig.report.ink import ACTUAL, GRID, INK, MODEL, OTHER, QUIET, SMALL_PT
from rig.results.tracking import AlternativeRun, ComparedRun
from rig.tissue.laws import FloatArray

COMPARED = {"Worst overshoot": ("overshoot_percent", "% of the jump"), "Worst settling": ("settling_s", "s")}
WORST_OF = {"worst": "", "worst_of_wrong": ", model half or twice as stiff"}
UNSETTLED = "no mark: a jump did not settle"
MARKS = (("o", ACTUAL), ("v", MODEL), ("^", MODEL), ("s", INK), ("D", OTHER), ("P", QUIET))


def comparison_figure(runs: Sequence[ComparedRun], simulated: Sequence[AlternativeRun]) -> Figure:
    """Worst overshoot [%] and settling [s] on each subject: bars of the bench, and a mark for each law simulated.

    Below, on tissue half and twice as stiff as learnt. All begin at 0; no bar or mark where a jump did not settle.
    """
    figure, subjects = new_figure(9.0, 7.4), [run.subject for run in runs]
    laws, at = list(dict.fromkeys(run.law for run in simulated)), np.arange(len(runs))
    for row, (which, tissue) in zip(figure.subplots(2, 2), WORST_OF.items(), strict=True):
        for axes, (title, (what, unit)) in zip(row, COMPARED.items(), strict=True):
            dress(axes, title + tissue, UNSETTLED if what == "settling_s" else "", unit)
            axes.set_xticks(at, subjects, fontsize=SMALL_PT)
            if which == "worst":
                axes.bar(at, _heights(runs, subjects, which, what), 0.8, color=GRID, label="force law on the bench")
            for number, law in enumerate(laws):
                heights = _heights([run for run in simulated if run.law == law], subjects, which, what)
                places, (mark, color) = at + (number - 2.5) / 8, MARKS[number]
                axes.plot(places, heights, mark, color=color, markersize=5, clip_on=False, label=f"{law}, simulated")
            axes.set(xlim=(-0.5, len(runs) - 0.5), ylim=(0.0, None))
    keys, texts = figure.axes[0].get_legend_handles_labels()
    figure.legend(keys, texts, loc="outside lower center", ncols=4, frameon=False, fontsize=SMALL_PT, labelcolor=INK)
    return figure


def _heights(
    runs: Sequence[ComparedRun] | Sequence[AlternativeRun], subjects: Sequence[str], which: str, what: str
) -> FloatArray:
    """Of each subject; NaN where there is none."""
    found = {run.subject: getattr(getattr(run, which), what) for run in runs}
    return np.array([found.get(subject) for subject in subjects], dtype=np.float64)
