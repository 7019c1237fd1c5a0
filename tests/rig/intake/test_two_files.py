"""A force in one file and a motion in another: joined where their names say so, else refused with a step that helps."""

from pathlib import Path

import pytest

from rig.errors import DataError
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.session import import_folder
from tests.rig.intake.makers import A, B, Press, rows
from tests.rig.intake.test_foreign import came_in
from tests.rig.intake.test_stated_elsewhere import check
from tests.rig.recording.measured import NOW


def apart(force: Path, way: Path, own: Press) -> None:
    """A file of force, and one of motion."""
    force.write_text("time_s,force_N\n" + rows("{:.3f},{:.5f}", own.time_s, own.force_N))
    way.write_text("time_s,position_mm\n" + rows("{:.3f},{:.5f}", own.time_s, own.way_mm))


def two_of_several(folder: Path) -> None:
    """A force and a motion in a file each, both of which begin their time anew."""
    force, way = ("".join(rows("{:.3f},{:.5f}", own.time_s, own[at]) for own in (A, B)) for at in (2, 1))
    (folder / "gel_force.csv").write_text(f"time_s,force_N\n{force}")
    (folder / "gel_position.csv").write_text(f"time_s,position_mm\n{way}")


def test_two_files_that_both_begin_anew_are_refused_with_a_step_that_helps(folder: Path) -> None:
    two_of_several(folder)
    proposal = propose(folder)
    mapping = DataMapping.model_validate(proposal.tree)
    said = r"recording gel-1 was there before in .*; two tables that each hold several recordings are not joined"
    with pytest.raises(DataError, match=f"{said}: save each recording in files of its own \\(as 1_force.csv and"):
        import_folder(folder, mapping, folder.parent / "out", NOW)
    for path in folder.iterdir():
        path.unlink()
    for number, own in enumerate((A, B), 1):  # as it says
        apart(folder / f"{number}_force.csv", folder / f"{number}_position.csv", own)
    check(came_in(folder), A, B)


@pytest.mark.parametrize(
    ("force", "way"), [("gel_1_f.csv", "gel_1.csv"), ("gel_1.frc", "gel_1.pos")], ids=["name and more", "other ending"]
)
def test_a_force_beside_a_motion_that_is_called_alike(folder: Path, force: str, way: str) -> None:
    for number, own in ((1, A), (10, B)):
        apart(folder / force.replace("1", str(number)), folder / way.replace("1", str(number)), own)
    check(came_in(folder), A, B)
