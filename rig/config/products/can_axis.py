"""What every servo axis on a CAN bus has in common."""

from typing import ClassVar, Self

from pydantic import Field, model_validator

from rig.config.can_adapter import CanInterface, Option, wrong_options, wrong_port
from rig.config.products.roles import MOCK_PORT, AxisProduct, Positive


class CanAxisProduct(AxisProduct):
    """A servo axis that is one node of a CANopen network."""

    # Lawicel CANUSB, and CANable with either of its firmwares.
    usb: ClassVar[tuple[str, ...]] = ("0403:ffa8", "16d0:117e", "ad50:60c4")

    interface: CanInterface = Field(default="slcan", description="kind of CAN adapter; port names what it needs")
    bitrate: int = Field(default=1_000_000, gt=0, description="of the CAN bus, bit/s")
    node: int = Field(default=1, ge=1, le=127, description="CANopen node of the drive")
    heartbeat_ms: int = Field(default=50, ge=5, description="period of the heartbeat each side sends")
    increments_per_rev: Positive = Field(default=10_000.0, description="four times the encoder's lines; scales rpm")
    homing_method: int = Field(default=17, ge=-128, le=37, description="of CiA 402-2; 17: negative limit switch")
    current_limit_A: Positive = Field(default=5.0, description="of the motor")
    shared: bool = Field(default=False, description="whether a plug-in's device is another node behind this adapter")
    adapter: dict[str, Option] = Field(default={}, description="options of this kind of adapter, see CAN adapters")

    @model_validator(mode="after")
    def _reachable(self) -> Self:
        wrong = wrong_options(self.interface, self.adapter) or wrong_port(self.interface, self.port, MOCK_PORT)
        if wrong:
            raise ValueError(wrong)
        return self
