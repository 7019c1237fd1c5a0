"""Makes the figures of the page on tissue: ``python -m tools.tissue_figures SESSION docs/figures`` (two minutes).

SESSION is any session with indentations; ``rig demo`` makes one in ``demo/session``. Prints the sweeps the page quotes.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from rig.recording.sessions import open_session
from rig.report.drawing import dress, label, new_figure, png
from rig.report.ink import ACTUAL, MODEL, OTHER, QUIET
from rig.report.lattice_figures import lattice_figure
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.sweep import Sweep, sweep
from rig.tissue.lattice_study import lattice_study
from rig.tissue.study import study_session

DPI = 90


def main() -> None:
    """Sweeps three lattices and fits one session."""
    session, folder = (Path(argument) for argument in sys.argv[1:3])
    folder.mkdir(parents=True, exist_ok=True)
    block = Block(quarter=True)
    sweeps = [
        ("study, constant k", sweep(block, Springs.for_mode("study"), 6.0, 0.25)),
        ("with cell volumes", sweep(block, Springs.for_mode("stabilised"), 11.0)),
    ]
    for name, found in sweeps:
        _print(name, found)
    _save(_collapse_figure(sweeps), folder / "tissue-collapse.png")
    study = study_session(open_session(session))
    _save(lattice_figure(study, lattice_study(study, Block())), folder / "tissue-lattice.png")


def _save(figure: Figure, file: Path) -> None:
    file.write_bytes(png(figure, dpi=DPI))


def _print(name: str, found: Sweep) -> None:
    sys.stdout.write(f"{name}: {found.collapse() or 'no collapse'}\n")
    for depth, phi, good in zip(found.depth_mm, found.force_over_k_mm, found.intact, strict=True):
        sys.stdout.write(f"  {depth:5.2f} mm  R/k {phi:8.3f} mm{'' if good else '  past collapse'}\n")


def _collapse_figure(sweeps: Sequence[tuple[str, Sweep]]) -> Figure:
    """phi(d) = R/k of several lattices; points past collapse are hollow."""
    figure = new_figure(7.5, 4.7)
    axes = figure.subplots()
    dress(axes, "Reaction over spring stiffness", "depth of the tip, mm", "R/k, mm")
    for (name, found), color in zip(sweeps, (MODEL, ACTUAL, OTHER, QUIET), strict=False):
        depth, phi = found.depth_mm, found.force_over_k_mm
        good = np.array(found.intact)
        axes.plot(depth, phi, color=color, linewidth=1.0)
        axes.plot(depth[good], phi[good], "o", color=color, markersize=4)
        axes.plot(depth[~good], phi[~good], "o", color=color, markersize=4, fillstyle="none")
        label(axes, (float(depth[-1]), float(phi[-1])), name, color, beside="above" if good.all() else "below")
    axes.margins(x=0.18)
    return figure


if __name__ == "__main__":
    main()
