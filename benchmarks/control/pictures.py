"""What the benchmark found, drawn: errors over force, and what each part of the law is worth."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.control.cases import FORCES_N, LIMB_HZ
from benchmarks.control.laws import ABLATIONS, LAW, OTHERS
from rig.report.drawing import dress, new_figure, save_figure, speed_colors
from rig.report.ink import INK, SMALL_PT

if TYPE_CHECKING:
    from benchmarks.control.__main__ import Cell

ABLATED_CASES = (
    "limb 2 Hz, 0.5 N", "limb 2 Hz, 10 N", "breathing, 0.5 N", "sine 2 Hz, x1", "low jumps, x2", "contact, 0 mm/s",
)  # fmt: skip
RIVALS = (LAW, "constant", *OTHERS)


def draw(cells: "Sequence[Cell]", folder: Path) -> None:
    """Writes the pictures for which there are numbers."""
    folder.mkdir(parents=True, exist_ok=True)
    means = {(cell.law, cell.case): cell.mean.value for cell in cells if cell.mean and cell.plant == "bench"}
    _limb(means, folder)
    if any(law in ABLATIONS for law, _ in means):
        _ablations(means, folder)


def _limb(means: dict[tuple[str, str], float], folder: Path) -> None:
    """Error where the limb moves: over force at 2 Hz, over frequency at 2 N."""
    figure = new_figure(9.0, 4.0)
    force, frequency = figure.subplots(1, 2, sharey=True)
    dress(force, "Limb moves 0.5 mm at 2 Hz", "force, N", "rms error, mN")
    dress(frequency, "Limb moves 0.5 mm at 2 N", "frequency, Hz", "")
    names = [law for law in RIVALS if (law, "limb 2 Hz, 2 N") in means]
    for law, color in zip(names, speed_colors(len(names)), strict=True):
        width = 2.2 if law == LAW else 1.0
        errors = [1000 * means[law, f"limb 2 Hz, {at:g} N"] for at in FORCES_N]
        force.loglog(FORCES_N, errors, "o-", color=color, linewidth=width, label=law)
        over = [
            (at, 1000 * means[law, f"limb {at:g} Hz, 2 N"]) for at in LIMB_HZ if (law, f"limb {at:g} Hz, 2 N") in means
        ]
        frequency.loglog(*zip(*over, strict=True), "o-", color=color, linewidth=width)
    force.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK)
    save_figure(figure, folder, "control-limb")


def _ablations(means: dict[tuple[str, str], float], folder: Path) -> None:
    """How many times worse each case is without one part of the law."""
    shown = [
        "limb 2 Hz, 0.5 N",
        "limb 2 Hz, 10 N",
        "breathing, 0.5 N",
        "sine 2 Hz, x2",
        "low jumps, x2",
        "contact, 0 mm/s",
    ]
    shown = [case for case in shown if (LAW, case) in means]
    figure = new_figure(8.0, 3.8)
    axes = figure.subplots()
    dress(axes, "Without one part of the law", "", "times as large")
    at = np.arange(len(shown))
    for number, (name, color) in enumerate(zip(ABLATIONS, speed_colors(len(ABLATIONS)), strict=True)):
        ratios = [means[name, case] / means[LAW, case] for case in shown]
        axes.bar(at + 0.2 * number - 0.3, ratios, 0.2, color=color, label=name)
    axes.set_yscale("log")
    axes.axhline(1.0, color=INK, linewidth=0.8)
    axes.set_xticks(at, shown, rotation=20, ha="right", fontsize=SMALL_PT)
    axes.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK)
    save_figure(figure, folder, "control-ablation")
