"""Every shared set that holds force against depth comes in and is fitted, with what its makers say of it.

The recordings stay outside the project: without them these tests skip, saying so.
"""

from pathlib import Path
from typing import NamedTuple

import pytest

from api.operations.fit import fit, fit_operation
from api.operations.records import import_data
from controller.operation import Operation
from rig.errors import UsageError
from rig.results.fit import FitResult
from rig.trials.opening import Opening
from tests.data import recording
from tests.rig.intake.test_real_folders import MAPPINGS, NOW

# `rig fit` says from here on that a law is none to track with: tissue half as stiff as the model.
NONE_TO_TRACK_WITH = 50.0


class Known(NamedTuple):
    """Of a set: its recordings, how many give a curve, the index law's largest error, and why others give none.

    ``deepest_mm`` and ``within_mm`` are the longest stroke as the set's description or another reader has it.
    """

    recordings: int
    used: int
    worst_percent: float
    reasons: tuple[str, ...]
    deepest_mm: float
    within_mm: float


IN_CONTACT = ("started in contact", "its surface lies between")
TISSUE = {
    # Four runs of six wells; three wells of the second were empty. Contact differs by millimetres.
    "asmi": Known(24, 15, 130.0, ("no contact", "its surface lies between"), 4.0, 0.5),
    # Six specimens, of two of which each has two further ramps from a hold.
    "soft_food": Known(10, 1, 30.0, IN_CONTACT, 2.0, 0.2),
    # Strips of 80 mm, the longest pulled to three times that; none is pressed, none is left out.
    "vhb4910": Known(9, 9, 150.0, (), 160.0, 2.0),
    "zwick_original": Known(17, 12, 60.0, IN_CONTACT, 7.5, 0.5),
    "perineal_indentation": Known(294, 245, 580.0, IN_CONTACT, 13.0, 0.5),
}
AXES = ("emps", "franka_joint", "rack_pinion", "servo_sts3215")


def check(found: FitResult, known: Known) -> None:
    assert len(found.trials) >= known.used
    unsaid = [one for one in found.skipped if not one.reason.startswith(known.reasons)]
    assert not unsaid
    recordings = [name.partition(", cycle ")[0] for name in (*found.trials, *(one.trial for one in found.skipped))]
    assert len(recordings) == len(set(recordings)) == known.recordings
    worst = found.laws["index"].worst_percent
    assert worst is not None and worst <= known.worst_percent
    assert any("none to track with" in remark for remark in found.remarks) == (worst > NONE_TO_TRACK_WITH)
    deepest_mm = max(speed.max_depth_mm for speed in found.speeds)
    assert deepest_mm == pytest.approx(known.deepest_mm, abs=known.within_mm)


@pytest.mark.parametrize("name", TISSUE)
def test_what_is_imported_by_its_mapping_is_fitted(name: str, tmp_path: Path) -> None:
    out = tmp_path / "session"
    came_in = import_data(Operation("import"), recording(name), MAPPINGS / f"{name}.toml", out, NOW)
    assert came_in.recordings == TISSUE[name].recordings
    check(fit(fit_operation(), [out], drawn=False), TISSUE[name])


@pytest.mark.parametrize("name", [name for name in TISSUE if name != "perineal_indentation"])
def test_what_nobody_described_is_fitted_likewise(name: str, tmp_path: Path) -> None:
    check(fit(fit_operation(), [recording(name)], tmp_path / "out", drawn=False), TISSUE[name])


@pytest.mark.parametrize("name", AXES)
def test_an_axis_without_tissue_is_refused_by_name(name: str, tmp_path: Path) -> None:
    opening = Opening(MAPPINGS / f"{name}.toml")
    with pytest.raises(UsageError, match=rf"{name}: is a drive axis, .* `rig diagnose` of .*{name} with that mapping"):
        fit(fit_operation(), [recording(name)], tmp_path / "out", opening=opening)
