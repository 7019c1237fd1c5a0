"""What a mock bench is calibrated with by itself the first time it is needed: said once, kept and used again.

Force sensor and axis are calibrated by the functions of `rig calibrate`, with weights that the mock bench puts on its
own tip, and in the air. Effects that are hidden in the bench are switched off meanwhile: a device is calibrated before
it goes wrong.
"""

import contextlib
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

import typer

from api.operations.calibrate import AxisAsked, GaugeBlock, ReadingTime, force_calibration_operation, measured_force
from controller.claims import state_folder
from controller.commissioning.axis import against_tracker, ahead_mm, known_direction
from controller.commissioning.axis_moves import Pace, RestingAxis, drive_to_positions
from controller.commissioning.weights import Weights
from controller.devices.drivers import start_devices
from mock_devices.control import BenchControl
from rig.config.axis_dynamics import AxisDynamics
from rig.config.calibration import AxisCalibration, ForceCalibration
from rig.config.calibration_files import read_axis, read_force, text_of
from rig.config.endpoints import Endpoints
from rig.config.products.firmata_glove import FirmataGlove
from rig.config.products.roles import MOCK_PORT, Product
from rig.config.wiring import Wiring
from rig.errors import DeviceError, RigError, UsageError
from rig.recording.files import make_folder, write_text

# Not loaded with the service: its process does it, and it brings along all that computes.
WORK = "api.cli.mock_work"
# Half a millimetre in front of what is touched.
NEAR_MM = 0.5
# Shares of limits.force_N; weights of the mock bench are exact.
SHARES = (0.1, 0.25, 0.5)
# Ten samples of the slower sensor; its filter and the tip's own take a few milliseconds.
BY_ITSELF = ReadingTime(settle_s=0.05, read_s=0.12)
# The simulated camera is 15 ms late; 18 frames at each place know the slope to 0.2 %.
PACE = Pace(speed_mm_s=20.0, settle_s=0.15, read_s=0.3)
AXIS_STEPS_MM = (2.0, 14.0, 2.0)
Made = TypeVar("Made", ForceCalibration, AxisCalibration, AxisDynamics)


def force_file(wiring: Wiring, endpoints: Endpoints) -> Path:
    """Where the calibration of this mock sensor is kept."""
    return mock_file(wiring.force, endpoints)


def mock_file(device: Product, endpoints: Endpoints, suffix: str = "") -> Path:
    """Another serial number, another file."""
    assert device.mock, "only what the mock bench serves is calibrated by itself"
    return state_folder() / f"{device.product}-{endpoints.serials[device.mock.role]}{suffix}.json"


def mock_force_calibration(wiring: Wiring, endpoints: Endpoints) -> ForceCalibration:
    """The calibration of the mock sensor at ``wiring.force.port``, made now where there is none that may be used."""
    file = force_file(wiring, endpoints)
    known = usable(read_force, file, wiring)
    return known or kept("the mock force sensor", _measured_force(wiring, endpoints), file)


def mock_axis_calibration(wiring: Wiring, endpoints: Endpoints) -> AxisCalibration | None:
    """The calibration of the mock axis against the mock tracker, made now where there is none that may be used.

    None where a marker is out of view or the limb's does not tell the sense, where the workspace is too short, and
    where the computer was too busy for it: the approach does not need it.
    """
    file = mock_file(wiring.axis, endpoints)
    if known := usable(read_axis, file, wiring):
        return known
    try:
        made = _measured_axis(wiring, endpoints)
    except DeviceError as error:
        say(f"the mock axis was not calibrated, next time again: {error}")
        return None
    return made and kept("the mock axis", made, file)


def usable(read: Callable[[Path], Made], file: Path, wiring: Wiring) -> Made | None:
    """What is kept in ``file``; None where there is nothing, or it may not be used any more."""
    with contextlib.suppress(UsageError):
        known = read(file)
        return None if wiring.calibration.alone(known).unfit(datetime.now(UTC)) else known
    return None


def mock_weights(wiring: Wiring, hung: bool = False) -> Weights:
    """The weights that the mock bench has."""
    largest_N = -wiring.limits.force_N if hung else wiring.limits.force_N
    return Weights(tuple(share * largest_N for share in SHARES), uncertainty=0.0)


def _measured_force(wiring: Wiring, endpoints: Endpoints) -> ForceCalibration:
    weights = mock_weights(wiring)
    with BenchControl(endpoints.control) as control, nothing_hidden(control), weights_on(control) as put_on:
        return measured_force(force_calibration_operation(weights), wiring.force, weights, put_on, BY_ITSELF)


def _measured_axis(wiring: Wiring, endpoints: Endpoints) -> AxisCalibration | None:
    places_mm = [wiring.limits.position_min_mm + step_mm for step_mm in AXIS_STEPS_MM]
    if max(places_mm) > wiring.limits.position_max_mm:
        return None
    with BenchControl(endpoints.control) as control, nothing_hidden(control), in_the_air(control):
        if not all(control.get("tracker.tip_in_view", "tracker.arm_in_view").values()):
            return None
        devices = start_devices(wiring)
        try:
            devices.axis.home()
            places = drive_to_positions(RestingAxis(devices, pace=PACE), places_mm)
        except DeviceError:
            # What the computer was too late for must not be found in fault by what comes next.
            with contextlib.suppress(RigError):
                devices.axis.reset_fault()
            raise
        finally:
            devices.close()
    known_by = known_direction(ahead_mm(places))
    if known_by is None:
        return None
    return against_tracker(devices.axis.identity, wiring.axis, places, known_by, datetime.now(UTC))


@contextlib.contextmanager
def weights_on(control: BenchControl) -> Iterator[Callable[[float], None]]:
    """Puts weights on the tip of the mock bench as a person would, and takes them off at the end."""

    def put_on(load_N: float) -> None:
        control.set({"load.axial_N": load_N})

    try:
        yield put_on
    finally:
        put_on(0.0)


@contextlib.contextmanager
def block_laid(control: BenchControl, asked: AxisAsked) -> Iterator[tuple[GaugeBlock, Callable[[], object]]]:
    """The block, and what lays it under the tip: the mock limb is its own table, and stands as before at the end."""
    table_mm, gauge_mm = control.number("surface.position_mm"), asked.gauge_block_mm or 0.0
    near_mm = table_mm - NEAR_MM if asked.near_mm is None else asked.near_mm
    try:
        yield GaugeBlock(gauge_mm, near_mm), lambda: control.set({"surface.position_mm": table_mm - gauge_mm})
    finally:
        control.set({"surface.position_mm": table_mm})


@contextlib.contextmanager
def in_the_air(control: BenchControl) -> Iterator[None]:
    """Without the limb."""
    present = bool(control.get("tissue.present")["tissue.present"])
    control.set({"tissue.present": False})
    try:
        yield
    finally:
        control.set({"tissue.present": present})


@contextlib.contextmanager
def nothing_hidden(control: BenchControl) -> Iterator[None]:
    """Without the effects that are hidden in it."""
    hidden = {f"{effect}.{name}": value for effect, values in control.truth().items() for name, value in values.items()}
    if hidden:
        control.hide({})
    try:
        yield
    finally:
        if hidden:
            control.hide(hidden)


def done_by_mock(wiring: Wiring) -> dict[str, str]:
    """By kind of job what calibrates a device whose port is `mock` in ``wiring``; nobody is asked for anything."""
    gloves = [product for product in wiring.input.values() if isinstance(product, FirmataGlove)]
    mock = {
        "force": wiring.force.port == MOCK_PORT,
        "axis": wiring.axis.port == MOCK_PORT,
        "dynamics": wiring.axis.port == MOCK_PORT,
        "glove": bool(gloves) and all(glove.port == MOCK_PORT for glove in gloves),
    }
    return {f"calibrate-{what}": f"{WORK}:calibrate_{what}" for what, is_mock in mock.items() if is_mock}


def say(sentence: str) -> None:
    """On stderr, beside what the command itself says."""
    typer.echo(sentence, err=True)


def kept(whose: str, made: Made, file: Path) -> Made:
    """``made``, said and kept in ``file``; a folder that cannot be written costs a calibration each time."""
    try:
        make_folder(file.parent)
        write_text(file, text_of(made))
        where = f"; kept in {file}"
    except RigError as error:
        where = f", and again next time: {error}"
    say(f"{whose} {made.product} {made.serial} was calibrated by itself{where}")
    return made
