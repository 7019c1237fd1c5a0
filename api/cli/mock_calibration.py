"""The mock force sensor's calibration: made by itself the first time it is needed, said once, kept and used again.

It is made by the functions of `rig calibrate force`, with weights that the mock bench puts on its own tip. Effects that
are hidden in the bench are switched off meanwhile: a sensor is calibrated before it goes wrong.
"""

import contextlib
import os
from collections.abc import Callable, Iterator
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import typer

from controller.commissioning.force import calibrate
from controller.commissioning.readings import read
from controller.commissioning.weights import Weights
from controller.devices import open_force
from mock_devices.control import BenchControl
from rig.config.calibration import ForceCalibration
from rig.config.calibration_files import read_force, text_of
from rig.config.wiring import Wiring
from rig.errors import RigError, UsageError
from rig.recording.files import make_folder, write_text

STATE = "XDG_STATE_HOME"
# Shares of limits.force_N; weights of the mock bench are exact.
SHARES = (0.1, 0.25, 0.5)
# Ten samples of the slower sensor; its filter and the tip's own take a few milliseconds.
READ_S, SETTLE_S = 0.12, 0.05


def state_folder() -> Path:
    """Where this computer keeps what it found out by itself (XDG Base Directory Specification)."""
    base = os.environ.get(STATE)
    return (Path(base) if base else Path.home() / ".local" / "state") / "tissue-rig"


def role_of(product: str) -> str:
    """The force sensor's role among the endpoints of the mock bench."""
    return "force_modbus" if product == "robotiq-ft300" else "force"


def mock_file(wiring: Wiring, endpoints: dict[str, Any]) -> Path:
    """Where the calibration of this mock sensor is kept: another serial number, another file."""
    product = wiring.force.product
    return state_folder() / f"{product}-{endpoints['serials'][role_of(product)]}.json"


def mock_calibration(wiring: Wiring, endpoints: dict[str, Any]) -> ForceCalibration:
    """The calibration of the mock sensor at ``wiring.force.port``, made now where there is none that may be used."""
    file = mock_file(wiring, endpoints)
    with contextlib.suppress(UsageError):
        known = read_force(file)
        if not wiring.calibration.model_copy(update={"of_force": known}).unfit(datetime.now(UTC)):
            return known
    made = _made(wiring, endpoints)
    typer.echo(
        f"the mock force sensor {made.product} {made.serial} was calibrated by itself{_kept(made, file)}", err=True
    )
    return made


def mock_weights(wiring: Wiring, hung: bool = False) -> Weights:
    """The weights that the mock bench has."""
    largest_N = -wiring.limits.force_N if hung else wiring.limits.force_N
    return Weights(tuple(share * largest_N for share in SHARES), uncertainty=0.0)


def _made(wiring: Wiring, endpoints: dict[str, Any]) -> ForceCalibration:
    with (
        BenchControl(endpoints["control"]) as control,
        _nothing_hidden(control),
        weights_on(control) as put_on,
        closing(open_force(wiring.force)) as sensor,
    ):
        sensor.start()
        return calibrate(
            sensor.identity,
            wiring.force,
            mock_weights(wiring),
            put_on,
            lambda: read(sensor, wiring.force.product, READ_S, SETTLE_S),
            datetime.now(UTC),
        )


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
def _nothing_hidden(control: BenchControl) -> Iterator[None]:
    hidden = {f"{effect}.{name}": value for effect, values in control.truth().items() for name, value in values.items()}
    if hidden:
        control.hide({})
    try:
        yield
    finally:
        if hidden:
            control.hide(hidden)


def _kept(made: ForceCalibration, file: Path) -> str:
    """Where it is kept; a folder that cannot be written costs a calibration each time, and is said."""
    try:
        make_folder(file.parent)
        write_text(file, text_of(made))
    except RigError as error:
        return f", and again next time: {error}"
    return f"; kept in {file}"
