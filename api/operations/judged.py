"""Which simulations can be judged; help says so without loading what judges them."""

from typing import Literal

Simulation = Literal["index", "constant"]
