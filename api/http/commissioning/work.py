"""Calibrations as jobs, each in a process of its own that has the device's port to itself."""

from collections.abc import Callable
from datetime import UTC, datetime

from api.http.commissioning.params import CalibrateForceParams
from api.http.jobs.work_science import relayed
from api.http.jobs.worker import Desk
from api.operations.calibrate import BY_HAND, ReadingTime, force_calibration_operation, load_request
from api.operations.calibrate import calibrate_force as measure
from api.operations.calibrations import keep, refuse_out, refuse_unfit
from controller.operation import Operation
from rig.results.bench import CalibrateResult


def calibrate_force(operation: Operation, asked: CalibrateForceParams, desk: Desk) -> CalibrateResult:
    """Asks for each load; the job is resumed once it rests on the tip."""
    return calibrated(operation, asked, desk, lambda load_N: desk.ask(load_request(load_N)))


def calibrated(
    operation: Operation,
    asked: CalibrateForceParams,
    desk: Desk,
    put_on: Callable[[float], object],
    rest: ReadingTime = BY_HAND,
) -> CalibrateResult:
    """The calibration under loads by ``put_on``, kept beside those of the command; CheckFailed says what is wrong."""
    refuse_out(None)
    weights = asked.up_to(desk.wiring.limits.force_N)
    found = measure(relayed(force_calibration_operation(weights), operation), desk.wiring, weights, put_on, rest)
    refuse_unfit(desk.wiring.calibration, found, datetime.now(UTC))
    return CalibrateResult(file=str(keep("force", found, None)), calibration=found)
