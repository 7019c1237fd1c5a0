"""What `rig fit --lattice` adds: tables, picture and numbers of the mass-spring lattice."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.progress import Progress

from api.cli.output import console, table, write_json
from rig.recording.files import whole_file
from rig.report.drawing import png
from rig.report.lattice_figures import lattice_figure
from rig.tissue.judging import Errors
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Mode
from rig.tissue.lattice_study import LatticeStudy, lattice_study
from rig.tissue.lattice_study import Progress as Tell
from rig.tissue.study import Study


def fit_lattice(
    study: Study, target: Path, block: Block | None = None, mode: Mode = "stabilised", search: bool = True
) -> dict[str, object]:
    """Runs the lattice on a fitted session, prints tables, writes lattice.png and lattice.json to ``target``; the JSON.

    The first run on a machine compiles the kernels (about a quarter of a minute) and keeps them.
    """
    with _progress() as tell:
        found = lattice_study(study, block or Block(), mode, search, tell)
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
    block = found.sweep.block
    size = " x ".join(map(str, block.nodes))
    points = [
        (
            f"{p.force_N:.2f}",
            f"{p.depth_mm:.2f}",
            f"{p.k_exact_N_mm:.5f}",
            f"{p.k_loop_N_mm:.5f}" if p.k_loop_N_mm else "--",
            f"{p.simulations}",
        )
        for p in found.points
    ]
    console.print(
        table(
            ("force N", "depth mm", "k exact N/mm", "k by search", "simulations"),
            points,
            f"Spring stiffness per force, {size} vertices",
        )
    )
    fit = found.index
    console.print(
        f"k(x) = {fit.a_N_mm:.4g} exp({fit.b_per_mm:.4g} x) N/mm; 95 %: a {fit.a_interval[0]:.4g} to "
        f"{fit.a_interval[1]:.4g}, "
        f"b {fit.b_interval[0]:.4g} to {fit.b_interval[1]:.4g}; R2 {fit.r_squared:.4f}",
        highlight=False,
    )
    if found.sweep.collapse():
        console.print(f"the lattice collapses: {found.sweep.collapse()}", highlight=False)
    header = ("model", "fitted mm", "%", "trial out mm", "%", "speed out mm", "%", "rms N")
    worst = [
        (name, *_pair(j.fitted), *_pair(j.trials_left_out), *_pair(j.speeds_left_out), f"{j.fitted.rmse_N:.3f}")
        for name, j in found.judged.items()
    ]
    console.print(table(header, worst, "Worst displacement errors, lattice and rivals"))
    control = [
        (
            f"{r.force_N:.2f}",
            f"{r.depth_mm:.2f}",
            f"{r.secant_N_mm:.3f}",
            f"{r.tangent_N_mm:.3f}",
            f"{r.damping_N_s_mm:.4f}",
            f"{r.damping_low_N_s_mm:.4f} to {r.damping_high_N_s_mm:.4f}",
        )
        for r in found.control
    ]
    console.print(
        table(
            ("force N", "depth mm", "secant K", "tangent K", "B N s/mm", "95 %"),
            control,
            "K and B for control (lattice index)",
        )
    )
    if found.rate is not None:
        rate = found.rate
        console.print(
            f"speed: B = {rate.B_N_s_mm:.4g} N s/mm (95 %: {rate.interval[0]:.4g} to {rate.interval[1]:.4g}, p "
            f"= {rate.p_value:.3g}, {rate.trials} trials); "
            f"slowest to fastest {rate.effect_N:.3g} N, scatter of trials {rate.spread_N:.2g} N; the study's "
            f"1.3 N s/mm would be {rate.study_effect_N:.3g} N",
            highlight=False,
        )


def _pair(errors: Errors | None) -> tuple[str, str]:
    return (f"{errors.max_error_mm:.3f}", f"{errors.max_error_percent:.1f}") if errors else ("--", "--")


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
        "index": {
            "a_N_mm": fit.a_N_mm,
            "b_per_mm": fit.b_per_mm,
            "a_interval": list(fit.a_interval),
            "b_interval": list(fit.b_interval),
            "r_squared": fit.r_squared,
        },
        "models": {
            name: {
                "formula": j.law.formula,
                "parameters": {p.name: p.value for p in j.law.parameters},
                "intervals": {key: list(value) for key, value in j.intervals.items()},
                "fitted": _errors(j.fitted),
                "trials_left_out": _errors(j.trials_left_out),
                "speeds_left_out": _errors(j.speeds_left_out),
            }
            for name, j in found.judged.items()
        },
        "control": [row._asdict() for row in found.control],
        "rate": None
        if found.rate is None
        else {
            **vars(found.rate),
            "study_effect_N": found.rate.study_effect_N,
            "excludes_study": found.rate.excludes_study,
        },
    }


def _errors(errors: Errors | None) -> dict[str, float | None] | None:
    if errors is None:
        return None
    values = {
        "max_error_mm": errors.max_error_mm,
        "max_error_percent": errors.max_error_percent,
        "rmse_N": errors.rmse_N,
    }
    return {name: value if math.isfinite(value) else None for name, value in values.items()}
