"""Real devices beside mock ones, in every mixture: a bench of its own stands in for the real devices."""

import select
import time
from collections.abc import Iterator
from itertools import product

import pytest

from api.cli.mock_bench import _arguments, bench_for, bench_process
from controller.devices.drivers import Devices, start_devices
from rig.config.endpoints import Endpoints
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.products.ndi_polaris import PolarisWiring
from rig.config.products.registry import FORCE_SENSORS
from rig.config.wiring import Wiring

WAIT_S = 10.0
MIXTURES = [mixture for mixture in product((False, True), repeat=3) if any(mixture) and not all(mixture)]


def test_the_mock_bench_is_not_asked_for_a_product_that_only_the_real_device_is() -> None:
    real = BotaWiring.model_construct(product="ati-axia", port="/dev/ttyUSB7")
    asked = _arguments(Wiring.model_construct(force=real, mock=Wiring().mock), (), None, every_product=False)
    assert "ati-axia" not in asked
    assert _arguments(Wiring(), (), None, every_product=False)[-6:] == [
        "--force", "bota-sensone", "--axis", "maxon-epos4", "--tracker", "ndi-polaris",
    ]  # fmt: skip


@pytest.fixture(scope="module")
def real() -> Iterator[Endpoints]:
    with bench_process(Wiring(), every_product=True) as (_, endpoints):
        yield endpoints


def wired(real: Endpoints, force: bool, axis: bool, tracker: bool, sensor: str = "bota-sensone") -> Wiring:
    """A wiring whose devices are real where true, mock where false."""
    role = "force" if sensor == "bota-sensone" else "force_modbus"
    ports = {
        "force": real.devices[role]["serial"] if force else "mock",
        "axis": real.devices["axis"]["slcan"] if axis else "mock",
        "tracker": "tcp://" + real.devices["tracker"]["tcp"] if tracker else "mock",
    }
    return Wiring(
        force=FORCE_SENSORS[sensor](port=ports["force"]),
        axis=Epos4Wiring(port=ports["axis"]),
        tracker=PolarisWiring(port=ports["tracker"]),
    )


def heard(devices: Devices) -> set[str]:
    """The roles that bring samples; the deadline only ends a test that has failed."""
    found: set[str] = set()
    deadline = time.monotonic() + WAIT_S
    while len(found) < 3 and time.monotonic() < deadline:
        now_ns = time.monotonic_ns()
        devices.axis.request(now_ns)
        found |= {"force"} if devices.force.poll(now_ns) else set()
        found |= {"axis"} if devices.axis.poll(now_ns) else set()
        found |= {"tracker"} if devices.tracker and devices.tracker.poll(now_ns) else set()
        select.select([], [], [], 0.002)
    return found


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
@pytest.mark.parametrize(("force", "axis", "tracker"), MIXTURES)
def test_every_mixture_starts_and_brings_samples(real: Endpoints, force: bool, axis: bool, tracker: bool) -> None:
    with bench_for(wired(real, force, axis, tracker), approaches=False) as (live, _):
        devices = start_devices(live)
        try:
            assert heard(devices) == {"force", "axis", "tracker"}
        finally:
            devices.close()


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
@pytest.mark.parametrize("force", [False, True])
def test_so_does_the_other_force_sensor(real: Endpoints, force: bool) -> None:
    with bench_for(wired(real, force, not force, False, "robotiq-ft300"), approaches=False) as (live, _):
        devices = start_devices(live)
        try:
            assert heard(devices) == {"force", "axis", "tracker"}
        finally:
            devices.close()
