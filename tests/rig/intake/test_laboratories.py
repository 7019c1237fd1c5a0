"""A foreign laboratory's files come in whole, ask what they do not say, or are refused with what to do."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rig.errors import DataError
from rig.intake.proposal import propose
from tests.rig.intake.laboratories import LABORATORIES, map_of_pressure, plate_alone
from tests.rig.intake.test_foreign import came_in

# What the files of a laboratory do not say, as a person answers it.
ANSWERS: dict[str, tuple[str, ...]] = {"markers_and_plate": ("N", "mm"), "bag_of_two_topics": ("N", "m")}


@pytest.mark.parametrize("form", LABORATORIES)
def test_every_recording_comes_in_whole(folder: Path, form: str) -> None:
    written = LABORATORIES[form](folder)
    session = came_in(folder, *ANSWERS.get(form, ()))
    assert len(session.trials) == len(written)
    for trial, own in zip(session.trials, written, strict=True):
        tables = session.recording(trial.name).tables
        force, axis = tables["force"], tables["axis"]
        assert np.diff(force["capture_ns"]) * 1e-9 == pytest.approx(np.diff(own.time_s), abs=1e-3)
        assert np.diff(axis["capture_ns"]) * 1e-9 == pytest.approx(np.diff(own.time_s), abs=1e-3)
        assert force["fz_N"] == pytest.approx(own.force_N, abs=1e-3 * np.ptp(own.force_N))
        assert axis["position_mm"] - axis["position_mm"][0] == pytest.approx(
            own.way_mm - own.way_mm[0], abs=1e-3 * np.ptp(own.way_mm)
        )


@pytest.mark.parametrize("write", [map_of_pressure, plate_alone], ids=lambda write: write.__name__)
def test_a_force_without_a_motion_is_refused_with_the_next_step(folder: Path, write: Callable[[Path], None]) -> None:
    write(folder)
    with pytest.raises(DataError, match=r"no table with force and position was found in it .* with --mapping"):
        propose(folder)
