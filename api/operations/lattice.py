"""The mass-spring lattice on a fitted session. Compiled kernels take seconds to load, so only who wants it does."""

from dataclasses import dataclass
from pathlib import Path

from rig.progress import Progress, silent
from rig.report.drawing import save_figure
from rig.report.lattice_figures import lattice_figure
from rig.results.fit import LatticeResult
from rig.results.lattice import lattice_result
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Mode
from rig.tissue.lattice_study import lattice_study
from rig.tissue.study import Study


@dataclass(frozen=True)
class LatticeFit:
    """Block and springs; ``search`` runs the study's own search too, ``stiffen`` lets each spring stiffen by itself."""

    block: Block
    mode: Mode = "stabilised"
    stiffen: bool = False
    search: bool = True

    @property
    def stages(self) -> int:
        """The sweep, the search, and two of springs that stiffen: b, and the whole block."""
        return 1 + self.search + 2 * self.stiffen

    def __call__(self, study: Study, target: Path, tell: Progress = silent) -> LatticeResult:
        """Runs it and writes lattice.png and .svg to ``target``.

        The first run on a machine compiles the kernels (a few seconds) and keeps them.
        """
        found = lattice_study(study, self.block, self.mode, self.search, tell, self.stiffen)
        save_figure(lattice_figure(study, found), target, "lattice")
        return lattice_result(found)
