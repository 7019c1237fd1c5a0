"""The lattice written a second time, slowly and without any trick: loops over pairs of nodes and corners of cells."""

from dataclasses import replace
from itertools import product

import numpy as np

from rig.tissue.lattice.block import Block
from rig.tissue.lattice.numba_types import Floats
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded

STEPS = [s for s in product((-1, 0, 1), repeat=3) if 0 < sum(map(abs, s)) < 3 and s > (0, 0, 0)]


def moduli(springs: Springs) -> tuple[float, float]:
    """Small-strain Young's modulus [MPa] at a spacing of 1 mm, and Poisson's ratio, of lambda = k + kv and G = k."""
    lame_MPa, shear_MPa = springs.k_N_mm * (1.0 + springs.cell_ratio), springs.k_N_mm
    nu = lame_MPa / (2.0 * (lame_MPa + shear_MPa))
    return 2.0 * shear_MPa * (1.0 + nu), nu


def untied(lattice: Loaded) -> Loaded:
    """The same without the ties of the tip's edge: springs and cells alone."""
    lattice.edge = replace(
        lattice.edge, nodes=lattice.edge.nodes[:0], stiffness=lattice.edge.stiffness[:0], rest=lattice.edge.rest[:, :0]
    )
    return lattice


def tie_energy(lattice: Loaded) -> float:
    """Energy of the ties in N mm: each is a spring of length 0 between a node and where the tip would have it."""
    total, d, b = 0.0, lattice.block.spacing_mm, lattice.springs.b
    for node, stiffness in zip(lattice.edge.nodes, lattice.edge.stiffness, strict=True):
        place = lattice.rest[:, node] - [0.0, 0.0, lattice.depth_mm]
        e = float(np.linalg.norm(place - lattice.x[:, node])) / d
        total += stiffness * d**2 * (0.5 * e * e if b == 0.0 else ((b * e - 1.0) * np.exp(b * e) + 1.0) / b**2)
    return float(total)


def energy(inner: Floats, springs: Springs, block: Block) -> float:
    """Energy of positions (3, nx, ny, nz) in N mm, by the formulas of the docstrings."""
    return _springs(inner, springs, block.spacing_mm) + _cells(inner, springs, block.spacing_mm)


def _springs(inner: Floats, springs: Springs, d: float) -> float:
    total = 0.0
    size = inner.shape[1:]
    for here in np.ndindex(size):
        for step in STEPS:
            there = tuple(int(h + s) for h, s in zip(here, step, strict=True))
            if any(not 0 <= t < n for t, n in zip(there, size, strict=True)):
                continue
            length = d * float(np.linalg.norm(step))
            gap = inner[:, there[0], there[1], there[2]] - inner[:, here[0], here[1], here[2]]
            e = abs(float(np.linalg.norm(gap)) / length - 1.0)
            b = springs.b
            shape = 0.5 * e * e if b == 0.0 else ((b * e - 1.0) * np.exp(b * e) + 1.0) / b**2
            total += springs.k_N_mm * length**2 * shape
    return float(total)


def _cells(inner: Floats, springs: Springs, d: float) -> float:
    total = 0.0
    nx, ny, nz = inner.shape[1:]
    for i, j, k in product(range(nx - 1), range(ny - 1), range(nz - 1)):
        for a, b, c in product((0, 1), repeat=3):
            edges = [
                inner[:, i + 1, j + b, k + c] - inner[:, i, j + b, k + c],
                inner[:, i + a, j + 1, k + c] - inner[:, i + a, j, k + c],
                inner[:, i + a, j + b, k + 1] - inner[:, i + a, j + b, k],
            ]
            jacobian = np.linalg.det(np.array(edges)) / d**3
            total += springs.cell_ratio * springs.k_N_mm * d**2 / 8.0 * (jacobian - 1.0 - np.log(jacobian))
    return float(total)
