"""What `rig fit --lattice` adds: tables, picture and numbers of the mass-spring lattice."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import get_args

from rich.progress import Progress

from api.cli.output import console, say, show
from rig.errors import UsageError
from rig.report.drawing import save_figure
from rig.report.lattice_figures import lattice_figure
from rig.results.fit import LatticeResult
from rig.results.lattice import lattice_result
from rig.results.tables import control_table, lattice_errors_table, lattice_sentences, spring_table
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Mode
from rig.tissue.lattice_study import lattice_study
from rig.tissue.per_spring import Progress as Tell
from rig.tissue.study import Study

BLOCK = re.compile(r"(\d+)x(\d+)x(\d+)(?:@(\d+(?:\.\d*)?|\.\d+))?")


def chosen(block: str, springs: str) -> tuple[Block, Mode]:
    """Block and mode from the command's options; raises UsageError for what is neither."""
    found = BLOCK.fullmatch(block.strip())
    if not found:
        raise UsageError(f"--block {block}: write vertices in x, y and z and their spacing in mm, like 51x51x40@1")
    if springs not in get_args(Mode):
        raise UsageError(f"--springs {springs}: choose {' or '.join(get_args(Mode))}")
    nx, ny, nz = (int(number) for number in found.groups()[:3])
    mode: Mode = "study" if springs == "study" else "stabilised"
    return Block((nx, ny, nz), spacing_mm=float(found[4] or 1.0)), mode


def fit_lattice(
    study: Study,
    target: Path,
    block: Block | None = None,
    mode: Mode = "stabilised",
    search: bool = True,
    stiffen: bool = False,
) -> LatticeResult:
    """Runs the lattice on a fitted session, prints tables, writes lattice.png, .svg and .json to ``target``.

    The first run on a machine compiles the kernels (a few seconds) and keeps them.
    """
    with _progress() as tell:
        found = lattice_study(study, block or Block(), mode, search, tell, stiffen)
    result = lattice_result(found)
    _show(result)
    save_figure(lattice_figure(study, found), target, "lattice")
    result.write(target / "lattice.json")
    say([f"lattice.png, lattice.svg and lattice.json are in {target}"])
    return result


@contextmanager
def _progress() -> Iterator[Tell]:
    with Progress(console=console, transient=True) as bar:
        tasks: dict[str, int] = {}

        def tell(stage: str, share: float) -> None:
            if stage not in tasks:
                tasks[stage] = int(bar.add_task(stage, total=1.0))
            bar.update(tasks[stage], completed=share)  # type: ignore[arg-type]

        yield tell


def _show(found: LatticeResult) -> None:
    show(spring_table(found))
    say(lattice_sentences(found))
    show(lattice_errors_table(found.models))
    show(control_table(found.control, "lattice index"))
