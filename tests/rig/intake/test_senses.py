"""The sense of a force is seen by where it begins, also of cycles that begin at once."""

from pathlib import Path

import numpy as np
import pytest

from rig.intake.proposal import propose
from tests.rig.intake.makers import rows


@pytest.mark.parametrize("name", ["Force (N)", "Compressive force (N)"])
@pytest.mark.parametrize("turns", [2, 12, 40])
def test_a_force_of_cycles_from_the_first_row_on_keeps_its_sign(folder: Path, name: str, turns: int) -> None:
    time_s = np.arange(800) * 0.02
    turned = np.pi * turns * time_s / 16
    for way_mm in (np.sin(2 * turned), np.sin(turned) ** 2):
        data = rows("{:.3f},{:.5f},{:.5f}", time_s, 3 * way_mm, 6 * way_mm)
        (folder / "a.csv").write_text(f"Time (s),Position (mm),{name}\n{data}")
        columns = propose(folder).tree["tables"][0]["columns"]
        assert [columns[quantity]["positive"] for quantity in ("force", "position")] == ["compression", "into"]
