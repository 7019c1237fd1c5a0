"""`rig calibrate force` on the mock bench, whose own weights are exact: what it has to refuse."""

from contextlib import closing
from datetime import UTC, datetime

from api.cli.mock_calibration import READ_S, SETTLE_S, weights_on
from controller.commissioning.force import calibrate
from controller.commissioning.readings import read
from controller.commissioning.weights import Weights
from controller.devices.drivers import open_force
from rig.config.wiring import Wiring
from tests.system.stage import Stage

SCENARIO = "commission"
LOADS_N = (2.0, 5.0, 10.0)


def commission(wiring: Wiring, bench: Stage) -> None:
    """Calibrates; raises RigError where it is refused."""
    with weights_on(bench.control) as put_on, closing(open_force(wiring.force)) as sensor:
        sensor.start()
        calibrate(
            sensor.identity,
            wiring.force,
            Weights(LOADS_N, uncertainty=0.0),
            put_on,
            lambda: read(sensor, wiring.force.product, READ_S, SETTLE_S),
            datetime.now(UTC),
        )
