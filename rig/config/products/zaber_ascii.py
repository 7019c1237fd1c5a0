"""Zaber linear axes with firmware 7, by their ASCII protocol."""

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from rig.config.products.roles import AxisProduct, MockPort, Positive

# Characters that one period puts on the line in the fuller direction: the replies to a move and to `get pos`.
REPLY_CHARACTERS = 70
# Above this share of the line replies wait for each other.
LINE_SHARE = 0.8
BITS = 10  # of a character, with start and stop


class ZaberWiring(AxisProduct):
    """A Zaber axis on a serial line or, as `tcp://host:55550`, on a network. It has no watch over the computer."""

    driver: ClassVar[str] = "drivers.zaber.device:open_axis"
    mock: ClassVar[MockPort | None] = MockPort("mock_devices.zaber.factory:zaber", "axis_ascii")
    advice: ClassVar[str] = "its power, the cable, axis.port, axis.baud, axis.device, and that it speaks ASCII"
    # At 20 to 200 Hz ten reports of one place are 50 to 500 ms of a set-point's way.
    patience: ClassVar[Mapping[str, Mapping[str, float]]] = {
        **AxisProduct.patience, "axis": {**AxisProduct.patience["axis"], "standstill_mm": 3.0},
    }  # fmt: skip

    product: Literal["zaber-ascii"] = Field(default="zaber-ascii", description="what stands on the bench")
    baud: int = Field(default=115_200, ge=9600, description="of the serial line")
    device: int = Field(default=1, ge=1, le=99, description="its number in the chain")
    axis_number: int = Field(default=1, ge=1, le=9, description="of the axis in the device")
    increments_per_mm: Positive = Field(default=2000.0, description="microsteps, as its data sheet says")
    rate_Hz: float = Field(default=100.0, ge=20, le=200, description="moves and positions a second")
    position: Literal["pos", "encoder.pos"] = Field(
        default="pos", description="what tells its place; without an encoder pos is what it was told"
    )
    lag_ms: float = Field(default=20.0, ge=0, le=100, description="from a set-point to the axis at it, line included")
    standstill_mm: Positive = Field(
        default=3.0, description="how far the set-point may go while ten reports of the axis name the same place"
    )
    bandwidth_Hz: Positive = Field(default=18.5, description="-3 dB of small motion at 100 moves a second")
    delay_ms: float = Field(default=25.0, ge=0, description="from command to motion, sensor included")

    @property
    def reports_Hz(self) -> float:
        """One for each move."""
        return self.rate_Hz

    @property
    def homes_outward(self) -> bool:
        """It homes towards smaller positions."""
        return self.direction == 1

    @model_validator(mode="after")
    def _line_carries_the_rate(self) -> Self:
        most_Hz = LINE_SHARE * self.baud / (BITS * REPLY_CHARACTERS)
        if self.rate_Hz > most_Hz and not self.port.startswith("tcp://"):
            raise ValueError(
                f"rate_Hz {self.rate_Hz:g}: {self.baud} baud carry {most_Hz:.0f} moves and positions a second;"
                " lower it, or raise baud"
            )
        return self
