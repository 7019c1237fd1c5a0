"""Maxon EPOS4, a servo drive behind a CAN adapter."""

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field

from rig.config.maxima import Maximum
from rig.config.products.can_axis import CanAxisProduct
from rig.config.products.roles import AxisProduct, MockPort

# Methods of CiA 402-2 (6098) that search for a switch or stop, by the direction in which they begin. Those that take
# the next index or the present position (33, 34, 37) would make any place the home, also one in the tissue.
NEGATIVE_METHODS = (-4, -2, 1, 11, 17, 27)
POSITIVE_METHODS = (-3, -1, 2, 7, 18, 23)
MAXIMA = (
    Maximum("axis.current_limit_A", 15.0, "A", "EPOS4 50/5: 5 A continuous, 15 A for seconds"),
    Maximum("axis.heartbeat_ms", 500.0, "ms", "alone, the drive stands within two of them: a second"),
)


class Epos4Wiring(CanAxisProduct):
    """A maxon EPOS4 behind a CAN adapter."""

    driver: ClassVar[str] = "drivers.epos4.device:Epos4Axis"
    mock: ClassVar[MockPort | None] = MockPort("mock_devices.devices:DeviceFactory.epos4", "axis", "slcan")
    advice: ClassVar[str] = "its power, the CAN cable and its terminators, axis.port, axis.node and axis.bitrate"
    patience: ClassVar[Mapping[str, Mapping[str, float]]] = {
        **AxisProduct.patience, "axis": {**AxisProduct.patience["axis"], "heartbeat_ms": 200},
    }  # fmt: skip

    product: Literal["maxon-epos4"] = Field(default="maxon-epos4", description="what stands on the bench")
    homing_method: Literal[-4, -3, -2, -1, 1, 2, 7, 11, 17, 18, 23, 27, 33, 34, 37] = Field(
        default=17, description="of CiA 402-2; 17: negative limit switch"
    )

    @property
    def maxima(self) -> tuple[Maximum, ...]:
        """Of what only this drive has."""
        return MAXIMA

    @property
    def homes_outward(self) -> bool:
        """Whether the search for the reference begins away from the tissue."""
        return self.homing_method in (NEGATIVE_METHODS if self.direction == 1 else POSITIVE_METHODS)
