"""Compression as every reader of a recording takes it: channel, sign and matrix, each with what is refused."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from controller.experiments.recorded import metadata
from controller.supervisor import Supervisor
from rig.channels import FORCE
from rig.config.calibration import Calibration, ForceCalibration
from rig.config.force_map import UNIT, ForceMap
from rig.config.wiring import Wiring
from rig.errors import DataError
from rig.recording.reader import Recording
from rig.recording.tables import compression_N, force_map
from tests.calibrations import force_calibration

MATRIX = ((1.0, 0.0, -0.004), (0.0, 1.0, 0.002), (0.01, 0.0, 1.02))


def recording(**calibration: str) -> Recording:
    force = np.zeros(2, FORCE.dtype)
    force["fx_N"], force["fy_N"], force["fz_N"] = [0.5, 1.0], [np.nan, 2.0], [-3.0, -4.0]
    return Recording(Path("trial.mcap"), {"calibration": calibration}, {"force": force}, (), True, ())


def test_without_a_calibration_compression_is_the_channel_with_its_sign() -> None:
    assert compression_N(recording()) == pytest.approx([3.0, 4.0])
    assert compression_N(recording(force_axis="fx", compression="positive")) == pytest.approx([0.5, 1.0])


def test_with_one_it_is_the_row_of_the_matrix() -> None:
    known = recording(force_axis="fz", compression="negative", matrix=json.dumps(MATRIX))
    assert compression_N(known) == pytest.approx([-(0.01 * 0.5 - 1.02 * 3.0), -(0.01 * 1.0 - 1.02 * 4.0)])


def test_force_is_the_whole_matrix_and_moments_are_as_read() -> None:
    known = ForceMap("fz", "negative", MATRIX)
    assert known.force_N(1.0, 2.0, -10.0) == pytest.approx((1.04, 1.98, -10.19))
    assert known.wrench((1.0, 2.0, -10.0, 0.1, 0.2, 0.3)) == pytest.approx((1.04, 1.98, -10.19, 0.1, 0.2, 0.3))
    assert known.compression_N(1.0, 2.0, -10.0) == pytest.approx(10.19)


@pytest.mark.parametrize("text", ["{", "[[1,0,0],[0,1,0]]", '[["1",0,0],[0,1,0],[0,0,1]]', "[1,2,3]"])
def test_a_matrix_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(DataError, match=r"trial: calibration matrix is .*; it must be three rows of three numbers"):
        force_map(recording(matrix=text))


def test_a_recording_says_all_of_the_calibration_it_was_made_with() -> None:
    known = force_calibration(matrix=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.01)))
    bench: Any = SimpleNamespace(
        wiring=Wiring(calibration=Calibration(of_force=known)), ready=SimpleNamespace(devices={}, realtime={})
    )
    said = metadata(cast(Supervisor, bench), "session", "trial_001", {})
    assert force_map(recording(**said["calibration"])) == known.map
    assert (
        ForceCalibration.model_validate_json(json.dumps(json.loads(said["wiring"]["calibration"])["of_force"])) == known
    )


def test_a_recording_made_without_one_has_the_unit_matrix() -> None:
    bench: Any = SimpleNamespace(wiring=Wiring(), ready=SimpleNamespace(devices={}, realtime={}))
    said = metadata(cast(Supervisor, bench), "session", "trial_001", {})
    assert force_map(recording(**said["calibration"])).matrix == UNIT
