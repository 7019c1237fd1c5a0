"""What `rig fit --lattice` adds: tables, picture and numbers of the mass-spring lattice."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import get_args

from rich.progress import Progress

from api.cli.fitting import print_control, worst_errors
from api.cli.output import console, table, write_json
from rig.errors import UsageError
from rig.recording.files import whole_file
from rig.report.drawing import png
from rig.report.lattice_figures import lattice_figure
from rig.tissue.judging import Judged
from rig.tissue.k_calculation import IndexFit
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Mode
from rig.tissue.lattice_study import LatticeStudy, lattice_study
from rig.tissue.per_spring import PerSpring
from rig.tissue.per_spring import Progress as Tell
from rig.tissue.results import errors_json
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
) -> dict[str, object]:
    """Runs the lattice on a fitted session, prints tables, writes lattice.png and lattice.json to ``target``; the JSON.

    The first run on a machine compiles the kernels (a few seconds) and keeps them.
    """
    with _progress() as tell:
        found = lattice_study(study, block or Block(), mode, search, tell, stiffen)
    _print(found)
    with whole_file(target / "lattice.png", overwrite=True) as scratch:
        scratch.write_bytes(png(lattice_figure(study, found)))
    result = lattice_json(found)
    write_json(target / "lattice.json", result)
    console.print(f"lattice.png and lattice.json are in {target}", highlight=False)
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


def _print(found: LatticeStudy) -> None:
    size = " x ".join(map(str, found.sweep.block.nodes))
    console.print(table(*_points(found), f"Spring stiffness per force, {size} vertices"))
    console.print(_law(found.index), highlight=False)
    if found.sweep.collapse():
        console.print(f"the lattice collapses: {found.sweep.collapse()}", highlight=False)
    console.print(table(*worst_errors(found.judged), "Worst displacement errors, lattice and rivals"))
    if found.per_spring is not None:
        console.print(_own(found.per_spring), highlight=False)
    print_control(found.control, "lattice index")


def _own(found: PerSpring) -> str:
    law, intervals = found.judged.law, found.judged.intervals
    values = [
        f"{p.name} = {p.value:.4g} {p.unit} ({intervals[p.name][0]:.4g} to {intervals[p.name][1]:.4g})"
        for p in law.parameters
    ]
    check = found.doubt() or f"the whole block agrees with its quarter to {found.agrees_to_mm:.3g} mm"
    return f"spring by spring: {', '.join(values)}; {check}"


def _points(found: LatticeStudy) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    header = ("force N", "depth mm", "k exact N/mm", "k by search", "simulations")
    return header, [
        (
            f"{p.force_N:.2f}", f"{p.depth_mm:.2f}", f"{p.k_exact_N_mm:.5f}",
            f"{p.k_loop_N_mm:.5f}" if p.k_loop_N_mm else "--", f"{p.simulations}",
        )
        for p in found.points
    ]  # fmt: skip


def _law(fit: IndexFit) -> str:
    (a_low, a_high), (b_low, b_high) = fit.a_interval, fit.b_interval
    return (
        f"k(x) = {fit.a_N_mm:.4g} exp({fit.b_per_mm:.4g} x) N/mm; 95 %: a {a_low:.4g} to {a_high:.4g}, "
        f"b {b_low:.4g} to {b_high:.4g}; R2 {fit.r_squared:.4f}"
    )


def lattice_json(found: LatticeStudy) -> dict[str, object]:
    """Everything as plain numbers; unknown ones are null."""
    fit, block = found.index, found.sweep.block
    return {
        "vertices": list(block.nodes),
        "spacing_mm": block.spacing_mm,
        "tip_diameter_mm": block.tip_diameter_mm,
        "contact": block.contact,
        "sides": block.sides,
        "mode": found.sweep.springs.mode,
        "collapse": found.sweep.collapse(),
        "phi": {
            "depth_mm": found.sweep.depth_mm.tolist(),
            "force_over_k_mm": found.sweep.force_over_k_mm.tolist(),
            "intact": found.sweep.intact,
        },
        "points": [vars(point) for point in found.points],
        "index": asdict(fit),
        "models": {name: _model(judged) for name, judged in found.judged.items()},
        "control": [row.model_dump() for row in found.control],
        "per_spring": None if found.per_spring is None else _check(found.per_spring),
    }


def _check(found: PerSpring) -> dict[str, object]:
    return {
        "depth_mm": found.depth_mm.tolist(),
        "quarter_force_over_k_mm": found.quarter_mm.tolist(),
        "whole_force_over_k_mm": found.whole_mm.tolist(),
        "agrees_to_mm": found.agrees_to_mm,
        "doubt": found.doubt(),
    }


def _model(judged: Judged) -> dict[str, object]:
    return {
        "formula": judged.law.formula,
        "parameters": {p.name: p.value for p in judged.law.parameters},
        "intervals": {name: list(interval) for name, interval in judged.intervals.items()},
        "fitted": errors_json(judged.fitted),
        "trials_left_out": errors_json(judged.trials_left_out),
        "speeds_left_out": errors_json(judged.speeds_left_out),
        "subjects_left_out": errors_json(judged.subjects_left_out),
    }
