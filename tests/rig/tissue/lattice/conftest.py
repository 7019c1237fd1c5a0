"""A block small enough to settle in milliseconds and large enough to have an inside."""

import pytest

from rig.tissue.lattice.block import Block

SMALL = (11, 11, 8)


@pytest.fixture
def block() -> Block:
    return Block(SMALL, tip_diameter_mm=4.0)
