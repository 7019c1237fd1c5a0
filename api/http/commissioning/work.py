"""Checks of devices and calibrations as jobs, each in a process of its own that has the devices to itself."""

from collections.abc import Callable
from pathlib import Path

from api.http.commissioning.params import (
    CalibrateAxisParams,
    CalibrateDynamicsParams,
    CalibrateForceParams,
    CalibrateGloveParams,
)
from api.http.jobs.params import NothingAsked
from api.http.jobs.work_science import relayed
from api.http.jobs.worker import Desk
from api.operations import doctor as examination
from api.operations.calibrate import (
    BY_HAND,
    AxisAsked,
    AxisStart,
    AxisTravel,
    GaugeBlock,
    ReadingTime,
    axis_by_block,
    axis_by_tracker,
    force_calibration_operation,
    load_request,
)
from api.operations.calibrate import calibrate_force as measure
from api.operations.calibrate_dynamics import axis_dynamics, sweep_asked, sweep_way
from api.operations.calibrations import keep_glove, kept
from api.operations.glove import HEAVIEST_N, calibration_operation, finger_request
from api.operations.glove import calibrate_glove as measure_glove
from controller.experiments.glove import glove_of
from controller.operation import Operation
from rig.results.bench import CalibrateResult, DoctorResult
from rig.results.glove import GloveCalibrated

TOWARD = (
    "no marker on the limb tells it: go on if the tip first went towards the limb's place; else cancel, and turn"
    " axis.direction"
)


def doctor(operation: Operation, _asked: NothingAsked, desk: Desk) -> DoctorResult:
    """Looks at each device for two seconds, while the service does not use the bench itself."""
    return examination.doctor(operation, desk.wiring)


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
    weights = asked.up_to(desk.wiring.limits.force_N, asked.load == "hung")
    found = measure(relayed(force_calibration_operation(weights), operation), desk.wiring, weights, put_on, rest)
    return kept(desk.wiring.calibration, found, None)


def calibrate_glove(operation: Operation, asked: CalibrateGloveParams, desk: Desk) -> GloveCalibrated:
    """Asks for each load on each finger; the job is resumed once it rests there."""
    return glove_calibrated(operation, asked, desk, lambda *load: desk.ask(finger_request(*load)))


def glove_calibrated(
    operation: Operation,
    asked: CalibrateGloveParams,
    desk: Desk,
    put_on: Callable[[str, float], object],
    rest: ReadingTime = BY_HAND,
) -> GloveCalibrated:
    """Likewise that of a glove."""
    weights, (name, glove) = asked.up_to(HEAVIEST_N), glove_of(desk.wiring, asked.input)
    inner = relayed(calibration_operation(glove, weights), operation)
    found = measure_glove(inner, desk.wiring, name, weights, put_on, rest)
    return GloveCalibrated(file=str(keep_glove(found, None)), calibration=found)


def calibrate_axis(operation: Operation, params: CalibrateAxisParams, desk: Desk) -> CalibrateResult:
    """Asks whether the way is free, then for the block, or where the tip went; the job is resumed once that is so."""
    asked = params.asked
    block = GaugeBlock(asked.gauge_block_mm, asked.near_mm or 0.0) if asked.gauge_block_mm else None
    return axis_calibrated(
        operation, asked, desk, block, lambda: desk.ask(asked.block_request), start(desk, asked.clear, asked.way)
    )


def axis_calibrated(
    operation: Operation,
    asked: AxisAsked,
    desk: Desk,
    block: GaugeBlock | None,
    put: Callable[[], object],
    begin: AxisStart,
) -> CalibrateResult:
    """The calibration against ``block``, which ``put`` lays there, or without one against the tracker; kept."""
    if block:
        found = axis_by_block(operation, desk.wiring, asked.from_mm, block, put, begin)
    else:
        travel = AxisTravel(asked.from_mm, asked.to_mm)
        found = axis_by_tracker(operation, desk.wiring, travel, lambda: _toward(asked.toward_limb, desk), begin)
    return kept(desk.wiring.calibration, found, None)


def _toward(said: bool | None, desk: Desk) -> bool:
    if said is None:
        desk.ask(TOWARD)
    return said is not False


def calibrate_dynamics(operation: Operation, asked: CalibrateDynamicsParams, desk: Desk) -> CalibrateResult:
    """Asks whether the way is free."""
    way = sweep_way(sweep_asked(desk.wiring, asked.from_mm), asked.from_mm)
    return dynamics_found(operation, asked, desk, start(desk, asked.clear, way))


def dynamics_found(
    operation: Operation, asked: CalibrateDynamicsParams, desk: Desk, begin: AxisStart
) -> CalibrateResult:
    """The dynamics, kept beside those of the command."""
    return kept(desk.wiring.calibration, axis_dynamics(operation, desk.wiring, asked.from_mm, begin), None)


def start(desk: Desk, clear: bool, way: str = "") -> AxisStart:
    """Once somebody says that ``way`` is free, unless that is known; stops come by the service's stop process."""

    def ask() -> None:
        if not clear:
            desk.ask(f"see that the tip's way is free from {way}, and the limb out: then the axis homes and moves")

    return AxisStart(ask, Path(desk.stop_word))
