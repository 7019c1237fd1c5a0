"""The mock axis is identified by itself the first time a force loop may need it: said once, kept and used again."""

import contextlib
from datetime import UTC, datetime
from pathlib import Path

from api.cli.mock_calibration import in_the_air, kept, mock_file, nothing_hidden, say, usable
from controller.commissioning.axis import as_answered
from controller.commissioning.axis_dynamics import SweepRecord, identify
from controller.commissioning.dynamics_refusals import dynamics_elsewhere
from controller.commissioning.sweep import AirSweep, sweep_for
from controller.commissioning.sweep_moves import SweepRun
from controller.devices.drivers import start_devices
from controller.loop.realtime import promptly
from drivers.roles import Identity
from mock_devices.control import BenchControl
from rig.computer import computer_id
from rig.config.axis_dynamics import AxisDynamics
from rig.config.calibration_files import read_dynamics
from rig.config.endpoints import Endpoints
from rig.config.wiring import Wiring
from rig.errors import CheckFailed, DeviceError, RigError, UsageError

# Four sweeps know delay and lags together to a tenth of a millisecond, and last three seconds.
SWEEP_S, REPEATS, TURNS = 0.5, 4, 2
FROM_MM, SPEED_MM_S = 2.0, 20.0
# Beside another bench one sweep in four misses the bounds; a computer may stand still for longer than a sample lasts.
TRIES = 8
Swept = tuple[Identity, Wiring, AirSweep, SweepRecord]


def mock_axis_dynamics(wiring: Wiring, endpoints: Endpoints) -> AxisDynamics | None:
    """The dynamics of the mock axis as this computer drives it, identified now where there are none that may be used.

    None where the workspace is too short, the axis is told less often than the loop decides, or the computer was too
    busy: the force loop is then refused.
    """
    file = dynamics_file(wiring, endpoints)
    known = usable(read_dynamics, file, wiring)
    if known and not dynamics_elsewhere(known, wiring):
        return known
    if wiring.axis.reports_Hz < wiring.loop.rate_Hz:
        return None  # it holds what it is told from one report to the next, which no sweep of each cycle allows for
    try:
        made = _identified(wiring, endpoints)
    except (CheckFailed, DeviceError, UsageError) as error:
        say(f"the mock axis was not identified, next time again: {error}")
        return None
    return kept("the mock axis' response", made, file)


def dynamics_file(wiring: Wiring, endpoints: Endpoints) -> Path:
    """Where they are kept: another rate or force sensor, another file."""
    return mock_file(wiring.axis, endpoints, f"-dynamics-{wiring.force.product}-{wiring.loop.rate_Hz:g}Hz")


def _identified(wiring: Wiring, endpoints: Endpoints) -> AxisDynamics:
    with BenchControl(endpoints.control) as control, nothing_hidden(control), in_the_air(control):
        for _ in range(TRIES - 1):
            with contextlib.suppress(CheckFailed, DeviceError):
                return identify(*swept(wiring), datetime.now(UTC), computer_id())
        return identify(*swept(wiring), datetime.now(UTC), computer_id())


def swept(wiring: Wiring, sweep_s: float = SWEEP_S, repeats: int = REPEATS) -> Swept:
    """What ``identify`` takes, of the mock axis homed and swept near the top; raises what a sweep raises."""
    devices = start_devices(wiring)
    try:
        answered = as_answered(wiring.axis, devices.axis.identity)
        sweep = sweep_for(wiring.model_copy(update={"axis": answered}), sweep_s, repeats, TURNS)
        devices.axis.home()
        devices.axis.move_to(wiring.limits.position_min_mm + FROM_MM, SPEED_MM_S)
        with promptly(wiring.loop.priority):
            devices.axis.enable()
            followed = SweepRun(devices, wiring, sweep).played()
    except DeviceError:
        # What the computer was too late for must not be found in fault by what comes next.
        with contextlib.suppress(RigError):
            devices.axis.reset_fault()
        raise
    finally:
        devices.close()  # before the fit: a drive that hears nothing for so long goes into fault
    return devices.axis.identity, wiring, sweep, followed
