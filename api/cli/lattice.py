"""Options of `rig fit --lattice`."""

import re
from typing import get_args

from api.operations.lattice import LatticeFit
from rig.errors import UsageError
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Mode

BLOCK = re.compile(r"(\d+)x(\d+)x(\d+)(?:@(\d+(?:\.\d*)?|\.\d+))?")


def lattice_from(block: str, springs: str, stiffen: bool) -> LatticeFit:
    """From the command's options; raises UsageError for what is neither block nor mode."""
    found = BLOCK.fullmatch(block.strip())
    if not found:
        raise UsageError(f"--block {block}: write vertices in x, y and z and their spacing in mm, like 51x51x40@1")
    if springs not in get_args(Mode):
        raise UsageError(f"--springs {springs}: choose {' or '.join(get_args(Mode))}")
    nx, ny, nz = (int(number) for number in found.groups()[:3])
    mode: Mode = "study" if springs == "study" else "stabilised"
    return LatticeFit(Block((nx, ny, nz), spacing_mm=float(found[4] or 1.0)), mode, stiffen)
