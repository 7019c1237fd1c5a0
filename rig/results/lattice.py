"""From a lattice study to its result."""

from rig.results.fit import LatticeResult, LatticeSweep, PerSpringResult
from rig.results.study import law_result
from rig.tissue.lattice.sweep import Sweep
from rig.tissue.lattice_study import LatticeStudy
from rig.tissue.per_spring import PerSpring


def lattice_result(found: LatticeStudy) -> LatticeResult:
    """The lattice study as it is saved."""
    block = found.sweep.block
    return LatticeResult(
        vertices=block.nodes, spacing_mm=block.spacing_mm, tip_diameter_mm=block.tip_diameter_mm, contact="bonded",
        sides="fixed", mode=found.sweep.springs.mode, collapse=found.sweep.collapse(), phi=_sweep(found.sweep),
        points=found.points, index=found.index,
        models={name: law_result(judged, found.force_N) for name, judged in found.judged.items()},
        per_spring=_per_spring(found.per_spring) if found.per_spring else None,
    )  # fmt: skip


def _sweep(found: Sweep) -> LatticeSweep:
    depth_mm, phi_mm = found.depth_mm.tolist(), found.force_over_k_mm.tolist()
    return LatticeSweep(depth_mm=depth_mm, force_over_k_mm=phi_mm, intact=tuple(found.intact))


def _per_spring(found: PerSpring) -> PerSpringResult:
    return PerSpringResult(
        law=found.judged.law.name,
        depth_mm=found.depth_mm.tolist(),
        quarter_force_over_k_mm=found.quarter_mm.tolist(),
        whole_force_over_k_mm=found.whole_mm.tolist(),
        agrees_to_mm=found.agrees_to_mm,
        doubt=found.doubt(),
    )
