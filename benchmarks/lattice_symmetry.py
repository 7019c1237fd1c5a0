"""Where a quarter of the lattice may stand for the whole: ``python -m benchmarks.lattice_symmetry [--nodes X Y Z]``.

Pushes the quarter and the shaken whole block to the same depths, with springs alone and with cell volumes, and prints
R/k of both. With the study's block it takes about five minutes on two cores.
"""

import argparse

import numpy as np

from rig.tissue.lattice.block import Block
from rig.tissue.lattice.fire import NotConverged
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.sweep import push
from rig.tissue.lattice.symmetry import shaken

CASES = (
    ("with cell volumes, constant k", Springs(1.0, 0.0, 1.0), 11.0, 1.0),
    ("with cell volumes, b = 8", Springs(1.0, 8.0, 1.0), 9.0, 1.0),
    ("with cell volumes, b = 16", Springs(1.0, 16.0, 1.0), 9.0, 1.0),
    ("springs alone, constant k", Springs(1.0, 0.0, 0.0), 4.0, 0.25),
    ("springs alone, b = 13", Springs(1.0, 13.0, 0.0), 10.5, 0.5),
)


def main() -> None:
    """One table per case; a case that does not settle says so and the next one runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nodes", type=int, nargs=3, default=(51, 51, 40), metavar=("X", "Y", "Z"))
    parser.add_argument("--deepest", type=float, default=np.inf, help="mm; go no deeper than this")
    options = parser.parse_args()
    for name, springs, deepest_mm, step_mm in CASES:
        print(f"{name}\n  depth mm   R/k quarter   R/k whole   difference   inverted cells, quarter and whole")
        depths = np.arange(step_mm, min(deepest_mm, options.deepest) + 1e-9, step_mm)
        block = Block(tuple(options.nodes))
        quarters = push(Loaded(block.as_quarter(), springs), depths)
        wholes = shaken(block, springs, depths.tolist(), np.random.default_rng(1))
        try:
            for quarter, whole in zip(quarters, wholes, strict=True):
                difference = whole.reaction_N / quarter.reaction_N - 1.0
                print(
                    f"  {quarter.depth_mm:8.2f}   {quarter.reaction_N:11.4f}   {whole.reaction_N:9.4f}   "
                    f"{100 * difference:8.3f} %   {quarter.inverted_cells} {whole.inverted_cells}",
                    flush=True,
                )
        except NotConverged as error:
            print(f"  {error}")


if __name__ == "__main__":
    main()
