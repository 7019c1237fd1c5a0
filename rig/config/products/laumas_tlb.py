"""LAUMAS TLB and TLU load-cell transmitters, and their relatives, by Modbus RTU: one channel of force."""

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from rig.config.maxima import Maximum
from rig.config.products.roles import ForceProduct, MockPort, Positive

BITS = 10  # of a character, with start and stop
USUAL_BAUD = 115_200
# A question of 8 bytes, an answer of 15, and the pause of 1.75 ms that the standard has before each.
CHARACTERS, PAUSES_S = 23, 0.0035


class LaumasWiring(ForceProduct):
    """A load-cell transmitter of the LAUMAS TLB and TLU family on a serial line. It measures Fz alone."""

    driver: ClassVar[str] = "drivers.laumas.device:open_sensor"
    mock: ClassVar[MockPort | None] = MockPort("mock_devices.laumas.factory:laumas", "force_gauge")
    advice: ClassVar[str] = "its power, the RS-485 adapter, force.port, force.baud and force.slave"
    # What its load cell bears is the cell's: `capacity_N`.
    range_N: ClassVar[float] = 1000.0
    range_N_m: ClassVar[float] = 0.0
    channels: ClassVar[tuple[str, ...]] = ("fz",)

    product: Literal["laumas-tlb"] = Field(default="laumas-tlb", description="what stands on the bench")
    rate_Hz: float = Field(default=100.0, ge=10, le=150, description="questions a second")
    axis: Literal["fz"] = Field(default="fz", description="the one channel that it has")
    slave: int = Field(default=1, ge=1, le=247, description="its Modbus address")
    weight: Literal["gross", "net"] = Field(default="gross", description="net changes with each tare at its keys")
    counts_per_N: Positive = Field(default=10_000.0, description="what it shows for one newton, without the point")
    capacity_N: Positive = Field(default=100.0, le=1000, description="of the load cell: beyond it nothing is valid")
    error_bits: int = Field(
        default=0xFFFF, ge=1, le=0xFFFF, description="of register 40007, those that its manual calls errors; else any"
    )

    @property
    def line_baud(self) -> int:
        """Bits a second of the line."""
        return self.baud or USUAL_BAUD

    @property
    def maxima(self) -> tuple[Maximum, ...]:
        """It knows no torque, so nothing limits what is asked of it there."""
        return (Maximum("limits.force_N", self.capacity_N, "N", f"the load cell of the {self.product} bears no more"),)

    @model_validator(mode="after")
    def _line_carries_the_rate(self) -> Self:
        most_Hz = 1 / (CHARACTERS * BITS / self.line_baud + PAUSES_S)
        if self.rate_Hz > most_Hz:
            raise ValueError(
                f"rate_Hz {self.rate_Hz:g}: {self.line_baud} baud carry {most_Hz:.0f} questions a second; lower it, or"
                " raise baud"
            )
        return self
