"""Jobs of a service over the mock bench that a person would do with their hands."""

from api.cli.mock_calibration import BY_ITSELF, weights_on
from api.http.commissioning.params import CalibrateForceParams
from api.http.commissioning.work import calibrated
from api.http.jobs.worker import Desk
from controller.operation import Operation
from mock_devices.control import BenchControl
from rig.results.bench import CalibrateResult


def calibrate_force(operation: Operation, asked: CalibrateForceParams, desk: Desk) -> CalibrateResult:
    """The mock bench puts the weights on its own tip."""
    with BenchControl(desk.hands) as control, weights_on(control) as put_on:
        return calibrated(operation, asked, desk, put_on, BY_ITSELF)
