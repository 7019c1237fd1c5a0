"""Real devices beside mock ones, in every mixture: a bench of its own stands in for the real devices."""

import select
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import pytest

from api.cli.mock_bench import _arguments, bench_for, bench_process
from controller.devices.drivers import Devices, start_devices
from mock_devices.testing.commands import ServedBench, rig
from rig.config.endpoints import Endpoints
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.products.ndi_polaris import PolarisWiring
from rig.config.products.registry import FORCE_SENSORS
from rig.config.wiring import Wiring
from rig.recording.reader import read_recording
from rig.recording.sessions import open_session
from rig.recording.verify import verdict_of

WAIT_S = 10.0
SURFACE_MM = 20.0
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
        axis=Epos4Wiring(port=ports["axis"], increments_per_mm=2000.0),
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


PRESS_ONCE = "speeds_mm_s = [20]\ntrials = 1\ndepth_mm = 6\n[quality]\nrepeats = 0\n"


@pytest.mark.extra
@pytest.mark.xdist_group("commands")
def test_a_capture_with_a_real_bench_and_a_mock_pedal_and_glove_is_whole(bench: ServedBench, tmp_path: Path) -> None:
    inputs = (
        "input.pedal.product=evdev-switch", "input.pedal.port=mock", "input.pedal.stops=pain",
        "input.glove.product=firmata-glove", "input.glove.port=mock",
    )  # fmt: skip
    (tmp_path / "one.toml").write_text(PRESS_ONCE)
    session = tmp_path / "session"
    said = rig("capture", tmp_path / "one.toml", "--out", session, *bench.settings(*inputs), folder=tmp_path)
    # A busy computer leaves gaps, which are its own: the trial then is bad (4), and is there.
    assert said.code in (0, 4), said.err
    (trial,) = open_session(session).trials
    assert trial.surface_mm == pytest.approx(SURFACE_MM, abs=0.2)
    recording = read_recording(session / "trial_001.mcap")
    assert recording.tables["axis"]["position_mm"].max() == pytest.approx(SURFACE_MM + 6.0, abs=0.5)
    assert len(recording.tables["glove"]) > 50 and not verdict_of(recording).streams["glove"].faults


@pytest.mark.extra
@pytest.mark.xdist_group("commands")
def test_a_mock_tracker_beside_a_real_axis_sees_another_tip_and_the_capture_is_stopped(
    bench: ServedBench, tmp_path: Path
) -> None:
    (tmp_path / "one.toml").write_text(PRESS_ONCE)
    session = tmp_path / "session"
    settings = bench.settings("tracker.port=mock")
    said = rig("capture", tmp_path / "one.toml", "--out", session, *settings, folder=tmp_path)
    assert said.code == 3 and "the tracker sees" in said.sentence and "for each mm of the axis" in said.sentence
    recording = read_recording(session / "trial_001.mcap")
    axis, marker = recording.tables["axis"], recording.tables["marker"]
    assert axis["position_mm"].max() - axis["position_mm"].min() > 2.0
    assert len(marker) > 20 and (marker["valid"] == 1).mean() > 0.95
    assert bench.control.number("tip.force_N") == 0.0
