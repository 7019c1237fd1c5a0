"""Stiffness under the tip from coarse to fine meshes: ``python -m benchmarks.mesh [--quick]``.

A layer 12 mm thick under a tip of 6 mm that slides, nu = 1/4, beside the exact solution of Hayes et al. (1972).
"""

import argparse
import json

import numpy as np

from rig.tissue.hayes import punch_stiffness_N_mm
from rig.tissue.lattice import newton
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded

RADIUS_MM, LAYER_MM, HALF_MM, YOUNG_MPA = 3.0, 12.0, 24.0, 0.25
SPACINGS_MM = (1.5, 1.0, 0.75, 0.6, 0.5, 0.4, 0.3)
FINEST = 6  # meshes of the line


def stiffness_N_mm(spacing_mm: float) -> float:
    """Small-depth stiffness; springs of k = 0.4 E d make a solid of Young's modulus E."""
    across, deep = (round(size / spacing_mm) for size in (2 * HALF_MM, LAYER_MM))
    block = Block((across + 1, across + 1, deep + 1), spacing_mm, 2 * RADIUS_MM, quarter=True, bonded=False)
    return newton.tangent_stiffness_N_mm(Loaded(block, Springs(0.4 * YOUNG_MPA * spacing_mm, 0.0, 0.0)))


def main() -> None:
    """Prints each mesh, then the limit; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="leaves out nothing: it takes half a minute")
    parser.parse_args()
    exact = punch_stiffness_N_mm(YOUNG_MPA, 0.25, RADIUS_MM, LAYER_MM)
    found = [stiffness_N_mm(spacing) for spacing in SPACINGS_MM]
    for spacing, stiffness in zip(SPACINGS_MM, found, strict=True):
        print(f"spacing {spacing:4.2f} mm: {stiffness:.4f} N/mm, {100 * (stiffness / exact - 1):+.1f} %")
    slope, limit = np.polyfit(SPACINGS_MM[-FINEST:], found[-FINEST:], 1)
    off = 100 * abs(limit / exact - 1)
    print(f"a line through the finest {FINEST}: limit {limit:.4f} N/mm, {slope:+.4f} N/mm a mm; exact {exact:.4f}")
    print(json.dumps({"spacing_mm": SPACINGS_MM, "stiffness_N_mm": found, "limit_N_mm": limit, "exact_N_mm": exact,
                      "off_percent": off}))  # fmt: skip


if __name__ == "__main__":
    main()
