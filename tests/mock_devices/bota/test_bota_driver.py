"""The maker's own driver, `bota-driver`, unchanged, against the simulated sensor: a session as its example has it.

It is a library of C++ that waits without end for what does not come, so that a process of its own runs it.
"""

import json
import re
import subprocess
import sys
import time
from typing import Any, NamedTuple

import pytest

from mock_devices.bota import mock as sensor
from mock_devices.testing.force import WRENCH, StillPlant
from mock_devices.testing.played import played
from mock_devices.wire import PtyWire

pytestmark = [pytest.mark.extra, pytest.mark.bench, pytest.mark.xdist_group("wire")]
SESSION = """
import json, sys
import bota_driver

config = bota_driver.BotaDriverConfig()
config.product_name, config.serial_number = "BFT-SENS-SER-M8", "SN000271"
config.communication_interface_name = "Bota_Binary_gen0"
line = bota_driver.BotaBinaryCommunicationInterfaceConfig()
line.com_port = sys.argv[1]
config.binary_communication_interface_params = line
sensor = bota_driver.Gen0SensorOperationConfig()
sensor.sinc_length = int(sys.argv[2])
sensor.wrench_offset = bota_driver.WrenchOffset()
config.gen0_sensor_operation_params = sensor
driver = bota_driver.BotaDriver(config)
result = {"configured": driver.configure(), "activated": driver.activate()}
frames = [driver.read_frame_blocking() for _ in range(60)]
result["expected_us"] = driver.get_expected_timestep_us()
result["steps_us"] = [after.timestamp - before.timestamp for before, after in zip(frames, frames[1:])]
result["wrench"] = [*frames[-1].force, *frames[-1].torque]
result["celsius"] = frames[-1].temperature
result["status"] = [frames[-1].status.val, frames[-1].status.raw]
result["deactivated"] = driver.deactivate()
result["tared"] = driver.tare()
result["again"] = driver.activate()
zeroed = driver.read_frame_blocking()
result["zeroed"] = [*zeroed.force, *zeroed.torque]
result["ended"] = [driver.deactivate(), driver.shutdown()]
print("\\n" + json.dumps(result), flush=True)
"""


class Session(NamedTuple):
    """What the driver got, and what it says of it."""

    result: dict[str, Any]
    said: str


def session(sinc: int) -> Session:
    mock = sensor.BotaMock(PtyWire(), StillPlant(), time.monotonic_ns())
    with played(mock):
        command = [sys.executable, "-c", SESSION, mock.endpoints()["serial"], str(sinc)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    said = re.sub(r"\x1b\[[\d;]*m", "", done.stdout + done.stderr)
    assert done.returncode == 0, said
    return Session(json.loads(next(line for line in said.splitlines() if line.startswith("{"))), said)


def is_as_the_maker_expects(sinc: int) -> None:
    """The step between frames is what the driver computes by itself from the length of the filter."""
    found, said = session(sinc)
    assert "Sensor model BFT-SENS-SER-M8 (SN000271)" in said
    assert [line for line in said.splitlines() if "ERROR" in line or "Timeout" in line] == []
    assert (found["configured"], found["activated"], found["again"], found["ended"]) == (True, True, True, [True, True])
    # A frame that is read again before the next one has come is the same one.
    assert min(step_us for step_us in found["steps_us"] if step_us) == pytest.approx(found["expected_us"], abs=1)
    assert found["wrench"] == pytest.approx(WRENCH) and found["celsius"] == pytest.approx(24.5)
    assert found["status"] == [0, 0]
    assert found["tared"] and found["zeroed"] == pytest.approx([0.0] * 6, abs=1e-6)


@pytest.mark.parametrize("sinc", [256, 1024])
def test_bota_driver_configures_streams_and_tares(sinc: int) -> None:
    is_as_the_maker_expects(sinc)


def samples_slower(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(sensor, "CONVERTER_HZ", 50_000)


def says_nothing_of_its_product(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(sensor.BotaMock, "_product_text", lambda _: b"")


def knows_no_offset_of_six_digits(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(sensor, "COMPLETE", re.compile(sensor.COMPLETE.pattern.replace(r"|(, *-?\d+\.\d{6}){6})|m", ")|m")))


PLANTED = (samples_slower, says_nothing_of_its_product, knows_no_offset_of_six_digits)


@pytest.mark.parametrize("plant", PLANTED, ids=lambda plant: plant.__name__)
def test_a_mistake_of_the_sensor_is_noticed(plant: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    plant(monkeypatch)
    with pytest.raises(AssertionError):
        is_as_the_maker_expects(256)
