"""`rig calibrate force` on the mock bench, whose own weights are exact: what it has to refuse."""

from api.cli.mock_calibration import BY_ITSELF, weights_on
from api.operations.calibrate import force_calibration_operation, measured_force
from controller.commissioning.weights import Weights
from mock_devices.testing.commands import ServedBench
from rig.config.wiring import Wiring

SCENARIO = "commission"
LOADS_N = (2.0, 5.0, 10.0)


def commission(wiring: Wiring, bench: ServedBench) -> None:
    """Calibrates; raises RigError where it is refused."""
    weights = Weights(LOADS_N, uncertainty=0.0)
    with weights_on(bench.control) as put_on:
        measured_force(force_calibration_operation(weights), wiring.force, weights, put_on, BY_ITSELF)
