"""Several tables in one group of a file of arrays are a recording each, however their columns are named."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from rig.intake.arrays import open_hdf5
from rig.recording.sessions import Session
from tests.rig.intake.makers import A, B, C
from tests.rig.intake.test_foreign import came_in

NAMES = ["time_s", "position_mm", "force_N"]
PRESSES = {"gel1": A, "gel2": B, "gel3": C}


def check(session: Session) -> None:
    """The presses are the recordings, value by value."""
    assert len(session.trials) == len(PRESSES)
    for trial, own in zip(session.trials, PRESSES.values(), strict=True):
        tables = session.recording(trial.name).tables
        assert tables["force"]["capture_ns"] == pytest.approx(own.time_s * 1e9, abs=1e3)
        assert tables["force"]["fz_N"] == pytest.approx(own.force_N, abs=1e-9)
        assert tables["axis"]["position_mm"] == pytest.approx(own.way_mm, abs=1e-9)


def named_by_an_attribute(folder: Path) -> None:
    with h5py.File(folder / "a.h5", "w") as file:
        for name, own in PRESSES.items():
            file.create_dataset(f"trials/{name}", data=np.stack(own, axis=1)).attrs["columns"] = NAMES


def rows_of_named_fields(folder: Path) -> None:
    with h5py.File(folder / "a.h5", "w") as file:
        for name, own in PRESSES.items():
            file[name] = np.array(list(zip(*own, strict=True)), [(field, "f8") for field in NAMES])


def told_by_units_alone(folder: Path) -> None:
    with h5py.File(folder / "a.h5", "w") as file:
        for name, own in zip(("a gel", "limb", "silicone"), PRESSES.values(), strict=True):
            file.create_dataset(name, data=np.stack(own, axis=1)).attrs["units"] = ["s", "mm", "N"]


def matrices_of_matlab(folder: Path) -> None:
    matrices = {name: np.stack(own, axis=1) for name, own in PRESSES.items()}
    scipy.io.savemat(folder / "a.mat", {**matrices, "names": np.array(NAMES, object)})


@pytest.mark.parametrize(
    "write", [named_by_an_attribute, rows_of_named_fields, told_by_units_alone, matrices_of_matlab]
)
def test_each_table_is_a_recording(folder: Path, write: Callable[[Path], None]) -> None:
    write(folder)
    check(came_in(folder))


def test_tables_that_say_nothing_of_their_columns_are_asked_of_as_one(folder: Path) -> None:
    with h5py.File(folder / "a.h5", "w") as file:
        for name, own in PRESSES.items():
            file[name] = np.stack(own, axis=1)
    check(came_in(folder, "3 N", "2 mm"))


def test_tables_have_the_one_time_beside_them(folder: Path) -> None:
    with h5py.File(folder / "a.h5", "w") as file:
        file["time_s"] = A.time_s
        for name, own in (("gel1", A), ("gel2", B)):
            file.create_dataset(name, data=np.stack(own[1:], axis=1)).attrs["columns"] = NAMES[1:]
    session = came_in(folder)
    forces = [session.recording(trial.name).tables["force"]["fz_N"] for trial in session.trials]
    assert np.array(forces) == pytest.approx(np.array([A.force_N, B.force_N]), abs=1e-9)


def test_vectors_of_several_directions_stay_one_table(folder: Path) -> None:
    with h5py.File(folder / "a.h5", "w") as file:
        file["time_s"], still = A.time_s, np.zeros_like(A.time_s)
        for name, values, unit in (("position", A.way_mm, "mm"), ("force", A.force_N, "N")):
            file.create_dataset(name, data=np.stack([still, still, values], axis=1)).attrs["unit"] = unit
    (trial,) = came_in(folder).trials
    assert trial.peak_force_N == pytest.approx(A.force_N.max())


def test_a_link_that_leads_nowhere_is_left_out(folder: Path) -> None:
    named_by_an_attribute(folder)
    with h5py.File(folder / "a.h5", "a") as file:
        file["trials/gone"] = h5py.SoftLink("/nowhere")
        file["raw"] = h5py.ExternalLink("raw.h5", "/force")
    check(came_in(folder))


@pytest.mark.parametrize("names", [("force", "pos"), ("image", "mask")])
def test_matrices_stay_together_that_are_channels_or_do_not_rise(folder: Path, names: tuple[str, str]) -> None:
    """Numbers without a sign rise by much where they fall by one; and a channel's name is no recording's."""
    counts = np.array([[9, 1], [7, 2], [5, 3], [3, 4]], np.uint16)
    matrices = (np.stack(A[:2], axis=1), np.stack(B[:2], axis=1)) if names[0] == "force" else (counts, counts)
    with h5py.File(folder / "a.h5", "w") as file:
        for name, matrix in zip(names, matrices, strict=True):
            file[name] = matrix
    (sheet,) = open_hdf5(folder / "a.h5")
    assert sheet.header == tuple(f"{name}:{number}" for name in names for number in (1, 2))
