"""Starts the mock bench for ports that say `mock`, and puts its endpoints in their place."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime

from api.cli.mock_calibration import mock_axis_calibration, mock_force_calibration
from api.cli.mock_dynamics import mock_axis_dynamics
from api.cli.mock_inputs import input_options, mock_inputs
from api.cli.options import calibrated
from controller.commissioning.refusals import refuse_uncalibrated, refuse_unstated_scale
from rig.config.endpoints import Endpoints
from rig.config.products.roles import MOCK_PORT, ForceProduct, Product, TrackerProduct
from rig.config.wiring import Wiring
from rig.errors import UsageError

# Below the loop: a simulated device must not wait for the desktop either, but never keeps the loop waiting.
BENCH_PRIORITY = 10


def _arguments(wiring: Wiring, hide: tuple[str, ...], seed: int | None, every_product: bool) -> list[str]:
    command = [sys.executable, "-m", "mock_devices.serve", "--with-parent", "--priority", str(BENCH_PRIORITY)]
    if wiring.mock.parameters:
        command += ["--parameters", str(wiring.mock.parameters)]
    if seed is not None:
        command += ["--seed", str(seed)]
    for effect in (*wiring.mock.hide, *hide):
        command += ["--hide", effect]
    command += input_options(wiring)
    # A real device's product may be one that the bench cannot play, and need not: it then plays them all.
    played = {} if every_product else mocks(wiring)
    return command + [part for role, device in played.items() for part in (f"--{role}", device.product)]


@contextmanager
def bench_process(
    wiring: Wiring, hide: tuple[str, ...] = (), seed: int | None = None, every_product: bool = False
) -> Iterator[tuple["subprocess.Popen[str]", Endpoints]]:
    """The mock bench as a process, and its endpoints; it ends with the block, or with this process."""
    process = subprocess.Popen(
        _arguments(wiring, hide, seed, every_product),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
        text=True,
    )
    assert process.stdin and process.stdout
    try:
        line = process.stdout.readline()
        if not line:
            raise UsageError("the mock bench did not start; its reason stands above")
        yield process, Endpoints.model_validate_json(line)
    finally:
        process.stdin.close()
        process.wait(10)
        process.stdout.close()


@contextmanager
def bench_for(
    wiring: Wiring, hide: tuple[str, ...] = (), approaches: bool = True, refuses: bool = True
) -> Iterator[tuple[Wiring, Endpoints | None]]:
    """``wiring`` with real endpoints, and what the mock bench said; without a port `mock` there is no mock bench.

    Where it ``approaches``, calibrations are read and checked before anything is opened, and a mock sensor that has
    none is calibrated. A service only looks and retracts at first: it starts whatever they say (``refuses`` false), and
    the loop refuses the approach.
    """
    if approaches:
        refuse_unstated_scale(wiring)
        wiring = calibrated(wiring)
    if approaches and refuses:
        refuse_uncalibrated(wiring, datetime.now(UTC))
    if not wiring.uses_mock:
        yield wiring, None
        return
    with bench_process(wiring, hide) as (_, endpoints):
        live = plug_into(wiring, endpoints) if approaches else at_endpoints(wiring, endpoints)
        if approaches and refuses:
            refuse_uncalibrated(live, datetime.now(UTC))
        yield live, endpoints


def plug_into(wiring: Wiring, endpoints: Endpoints) -> Wiring:
    """``wiring`` on the mock bench's endpoints, with calibrations of what is a mock: its force sensor, and its axis.

    A calibration that the wiring brings along is kept, whosever it is. A mock axis is seen by the mock tracker alone.
    """
    live = at_endpoints(wiring, endpoints)
    known, tracker = live.calibration, wiring.tracker
    if wiring.force.port == MOCK_PORT and not known.of_force:
        known = known.model_copy(update={"of_force": mock_force_calibration(live, endpoints)})
    seen = tracker is not None and tracker.port == wiring.axis.port == MOCK_PORT
    if seen and not known.of_axis:
        known = known.model_copy(update={"of_axis": mock_axis_calibration(live, endpoints)})
    if wiring.axis.port == MOCK_PORT and not known.of_dynamics:
        known = known.model_copy(update={"of_dynamics": mock_axis_dynamics(live, endpoints)})
    return live.model_copy(update={"calibration": known})


def at_endpoints(wiring: Wiring, endpoints: Endpoints) -> Wiring:
    """``wiring`` with each port `mock` replaced by the endpoint that serves it, and as patient as that needs.

    Where the wiring states no latency for a mock device, it takes what the device's data sheet would say.
    """
    live = patient(wiring)
    devices: dict[str, object] = {role: _served(device, endpoints) for role, device in mocks(live).items()}
    inputs = {name: _served(device, endpoints) for name, device in mock_inputs(live).items()}
    return live.model_copy(update={**devices, "input": {**live.input, **inputs}})


def mocks(wiring: Wiring) -> dict[str, Product]:
    """The devices that the mock bench is to serve, by role; raises UsageError where it cannot serve one."""
    found: dict[str, Product] = {}
    for role, device in (("force", wiring.force), ("axis", wiring.axis), ("tracker", wiring.tracker)):
        if device is None or device.port != MOCK_PORT:
            continue
        if device.mock is None:
            raise UsageError(f"{role}.port mock: the mock bench has no {device.product}; give the port of a real one")
        found[role] = device
    return found


def _served(device: Product, endpoints: Endpoints) -> Product:
    assert device.mock
    known = {"port": device.mock.address(endpoints)}
    if not isinstance(device, ForceProduct | TrackerProduct):
        return device.model_copy(update=known)
    stated_ms = endpoints.latency_ms.get(device.mock.role, 0.0)
    return device.model_copy(update=known | {"latency_ms": device.latency_ms or stated_ms})


def patient(wiring: Wiring) -> Wiring:
    """``wiring`` with limits of time that mock devices can keep; what the wiring itself states is kept."""
    for device in mocks(wiring).values():
        for section, values in device.patience.items():
            table = getattr(wiring, section)
            unsaid = {key: value for key, value in values.items() if key not in table.model_fields_set}
            wiring = wiring.model_copy(update={section: table.model_copy(update=unsaid)})
    return wiring
