"""The study's whole argument on a session's curves, with the lattice: k per force, constant against index model,
alternatives, K and B for control.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rig.errors import DataError
from rig.progress import Progress, silent
from rig.tissue.fitting import fit_law
from rig.tissue.judging import Judged, judge
from rig.tissue.k_calculation import exact_k, fit_index, study_loop
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Mode, Springs
from rig.tissue.lattice.sweep import DEFAULT_STEP_MM, Sweep, sweep
from rig.tissue.laws import FloatArray
from rig.tissue.laws_lattice import lattice_laws
from rig.tissue.per_spring import PerSpring, per_spring
from rig.tissue.registry import THREE_PARAMETER
from rig.tissue.study import Study, rows
from rig.tissue.summary import IndexFit, KPoint

_DEPTH_MARGIN = 1.02  # so that the deepest force has a depth on either side of it
_DEEPEST_SHARE = 0.85  # a sweep may reach 0.9


@dataclass(frozen=True)
class LatticeStudy:
    """Results; ``judged`` holds lattice and lumped laws by name, on the same curves, forces [N] and origins."""

    sweep: Sweep
    points: tuple[KPoint, ...]
    index: IndexFit
    judged: Mapping[str, Judged]
    force_N: FloatArray
    per_spring: PerSpring | None = None


def lattice_study(
    study: Study,
    block: Block,
    mode: Mode = "stabilised",
    search: bool = True,
    tell: Progress = silent,
    stiffen: bool = False,
) -> LatticeStudy:
    """Sweep the block once, then everything else from phi; ``search`` also runs the study's loop for each force,
    ``stiffen`` also fits a and b of every spring.

    ``tell(stage, share)`` is called as it goes. Raises UsageError where the block cannot carry the depths (with the
    bound).
    """
    deepest_mm = _deepest(study, block)
    curve = _sweep(block, mode, deepest_mm, tell)
    table = rows(study.judged[study.closest].fitted)
    points = exact_k(curve, np.array([row.force_N for row in table]), np.array([row.measured_mm for row in table]))
    if search:
        points = study_loop(points, curve, lambda done: tell("search for k per force", done / len(table)))
    judged = dict(study.judged)
    for kind in (*lattice_laws(curve), *THREE_PARAMETER):
        if kind.name not in judged:
            judged[kind.name] = judge(fit_law(kind, study.curves), study.curves, study.force_N, study.origins_mm)
    own = per_spring(study, block, mode, deepest_mm, tell) if stiffen else None
    if own is not None:
        judged[own.judged.law.name] = own.judged
    return LatticeStudy(curve, tuple(points), fit_index(points), judged, study.force_N, own)


def _deepest(study: Study, block: Block) -> float:
    deepest = _DEPTH_MARGIN * max(curve.max_depth_mm + max(0.0, -curve.offset_bounds_mm[0]) for curve in study.curves)
    limit = _DEEPEST_SHARE * block.height_mm
    if deepest > limit:
        raise DataError(
            f"{study.session}: the curves go {deepest:.3g} mm deep; a block {block.height_mm:g} mm high is "
            f"simulated to {limit:.3g} mm at most: "
            "give a block with more vertices in z"
        )
    return deepest


def _sweep(block: Block, mode: Mode, deepest_mm: float, tell: Progress) -> Sweep:
    return sweep(
        block.as_quarter(),
        Springs.for_mode(mode),
        deepest_mm,
        DEFAULT_STEP_MM * block.spacing_mm,
        lambda d: tell("sweep of phi", d / deepest_mm),
    )
