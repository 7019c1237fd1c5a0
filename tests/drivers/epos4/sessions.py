"""A servo axis on the bench, and one turn of a loop."""

from typing import Any

from drivers.epos4.device import Epos4Axis
from mock_devices.testing.epos4 import DriveBench
from rig.channels import AxisSample
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits


def axis_on(bench: DriveBench, limits: Limits | None = None, **config: Any) -> Epos4Axis:
    return Epos4Axis(Epos4Wiring(port="memory", **config), limits or Limits(), bench.now, open_link=bench.open)


def tick(bench: DriveBench, axis: Epos4Axis, position_mm: float) -> list[AxisSample]:
    """One turn of a loop at 1 kHz."""
    bench.run(0.001)
    samples = axis.poll(bench.now())
    axis.command(position_mm, bench.now())
    return list(samples)
