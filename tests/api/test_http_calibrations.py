"""Calibrations over HTTP: what is used, what lies beside it, and what is wrong with a file."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from api.http.service import Service
from mock_devices.testing.access import client_of
from rig.config.calibration import AxisCalibration, AxisStep, Calibration
from rig.config.calibration_files import text_of
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring


def axis(serial: str, year: int, uncertainty: float = 0.001) -> AxisCalibration:
    return AxisCalibration(
        product="an axis", serial=serial, date=datetime(year, 1, 2, tzinfo=UTC), scale=1.0, uncertainty=uncertainty,
        direction=1, direction_known_by="operator", increments_per_mm=1000.0, reference="gauge block",
        steps=(AxisStep(axis_mm=0.0, reference_mm=0.0), AxisStep(axis_mm=10.0, reference_mm=10.0)),
    )  # fmt: skip


def test_calibrations_in_use_come_first_and_each_says_why_it_would_be_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "calibration"
    folder.mkdir()
    this_year = datetime.now(UTC).year - 1
    made = {
        "axis-7.json": axis("7", this_year),
        "axis-6.json": axis("6", 1999),
        "axis-5.json": axis("5", this_year, 0.05),
    }
    for name, one in made.items():
        (folder / name).write_text(text_of(one))
    (folder / "force-1.json").write_text("no JSON")
    known = Calibration(axis=Path("calibration/axis-7.json"), of_axis=made["axis-7.json"], max_age_days=730)
    service = Service(Wiring(force=BotaWiring(port="/dev/none"), calibration=known), tmp_path, tmp_path)
    found = client_of(service).get("/api/v1/calibrations").json()["items"]
    assert [(one["serial"], one["used"]) for one in found] == [("7", True), ("5", False), ("6", False), ("", False)]
    assert found[0]["refused"] == "" and found[0]["uncertainty_percent"] == pytest.approx(0.1)
    assert "uncertain by 5 %" in found[1]["refused"] and "days old" in found[2]["refused"]
    assert "cannot be read as JSON" in found[3]["refused"] and found[3]["file"] == "calibration/force-1.json"
