"""Jobs of a service over the mock bench that a person would do with their hands."""

from contextlib import ExitStack

from api.cli.calibrate_glove import MOCK_REST, weights_on_glove
from api.cli.mock_calibration import BY_ITSELF, block_laid, in_the_air, weights_on
from api.http.commissioning.params import (
    CalibrateAxisParams,
    CalibrateDynamicsParams,
    CalibrateForceParams,
    CalibrateGloveParams,
)
from api.http.commissioning.work import axis_calibrated, calibrated, dynamics_found, glove_calibrated, start
from api.http.jobs.worker import Desk
from controller.experiments.glove import glove_of
from controller.operation import Operation
from mock_devices.control import BenchControl
from rig.results.bench import CalibrateResult
from rig.results.glove import GloveCalibrated


def calibrate_force(operation: Operation, asked: CalibrateForceParams, desk: Desk) -> CalibrateResult:
    """The mock bench puts the weights on its own tip."""
    with BenchControl(desk.hands) as control, weights_on(control) as put_on:
        return calibrated(operation, asked, desk, put_on, BY_ITSELF)


def calibrate_glove(operation: Operation, asked: CalibrateGloveParams, desk: Desk) -> GloveCalibrated:
    """The mock bench puts the weights on its own glove."""
    with BenchControl(desk.hands) as control:
        put_on = weights_on_glove(control, glove_of(desk.wiring, asked.input)[1])
        return glove_calibrated(operation, asked, desk, put_on, MOCK_REST)


def calibrate_axis(operation: Operation, params: CalibrateAxisParams, desk: Desk) -> CalibrateResult:
    """The mock limb is table and block; nothing is in the way."""
    asked, begin = params.asked, start(desk, clear=True)
    with ExitStack() as held:
        control = held.enter_context(BenchControl(desk.hands))
        if asked.gauge_block_mm:
            block, put = held.enter_context(block_laid(control, asked))
            return axis_calibrated(operation, asked, desk, block, put, begin)
        return axis_calibrated(operation, asked, desk, None, lambda: None, begin)


def calibrate_dynamics(operation: Operation, asked: CalibrateDynamicsParams, desk: Desk) -> CalibrateResult:
    """The limb is away meanwhile."""
    with BenchControl(desk.hands) as control, in_the_air(control):
        return dynamics_found(operation, asked, desk, start(desk, clear=True))
