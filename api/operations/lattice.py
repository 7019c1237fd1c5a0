"""The mass-spring lattice on a fitted session. Compiled kernels take seconds to load, so only who wants it does."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from rig.errors import UsageError
from rig.progress import Progress, silent
from rig.report.drawing import save_figure
from rig.report.lattice_figures import lattice_figure
from rig.results.fit import LatticeResult
from rig.results.lattice import lattice_result
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Mode
from rig.tissue.lattice_study import lattice_study
from rig.tissue.study import Study

BLOCK = re.compile(r"(\d+)x(\d+)x(\d+)(?:@(\d+(?:\.\d*)?|\.\d+))?")


def lattice_from(block: str, springs: str, stiffen: bool) -> "LatticeFit":
    """From what a person wrote; raises UsageError for what is neither block nor mode."""
    found = BLOCK.fullmatch(block.strip())
    if not found:
        raise UsageError(f"--block {block}: write vertices in x, y and z and their spacing in mm, like 51x51x40@1")
    if springs not in get_args(Mode):
        raise UsageError(f"--springs {springs}: choose {' or '.join(get_args(Mode))}")
    nx, ny, nz = (int(number) for number in found.groups()[:3])
    mode: Mode = "study" if springs == "study" else "stabilised"
    return LatticeFit(Block((nx, ny, nz), spacing_mm=float(found[4] or 1.0)), mode, stiffen)


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
