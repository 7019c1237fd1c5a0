"""What a laboratory may ask of its protocol in every commit: see `laboratory.yml`."""

from pathlib import Path

from mock_devices.testing.hand import MockBench
from mock_devices.testing.service import ServedRig


def test_our_bench_is_well(mock_bench: MockBench, tmp_path: Path) -> None:
    said = mock_bench.rig("doctor", folder=tmp_path)
    assert said.code == 0, said.err


def test_a_frozen_sensor_is_noticed_by_doctor(mock_bench: MockBench, tmp_path: Path) -> None:
    mock_bench.fault("force", "silent", True)
    said = mock_bench.rig("doctor", folder=tmp_path)
    assert said.code == 1 and "force" in said.err


def test_friction_can_be_hidden_and_is_gone_in_the_next_test(mock_bench: MockBench) -> None:
    mock_bench.hide({"friction.level_N": 0.2})
    assert mock_bench.control.truth()["friction"]["level_N"] == 0.2


def test_nothing_is_left_of_the_tests_before(mock_bench: MockBench) -> None:
    assert mock_bench.control.truth() == {}


def test_the_service_is_idle_and_knows_our_devices(service: ServedRig) -> None:
    assert service.rig["state"] == "idle"
    assert "bota-sensone" in {one["product"] for one in service.ask("GET", "/devices")["products"]}
