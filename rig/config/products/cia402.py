"""Any servo drive of the profile CiA 402 on a CAN bus, known by its electronic data sheet."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Literal

from pydantic import Field

from rig.config.products.can_axis import CanAxisProduct
from rig.config.products.roles import MockPort

# Methods of CiA 402-2 that search for a switch, by the direction in which they begin.
OUTWARD = {1: (1, 11, 12, 13, 14, 17, 27, 28, 29, 30), -1: (2, 7, 8, 9, 10, 18, 23, 24, 25, 26)}


class Cia402Wiring(CanAxisProduct):
    """A servo drive of the profile CiA 402 behind a CAN adapter.

    ``lead_mm`` lets the driver hold `increments_per_mm` against the drive's own factors, or take it from them.
    """

    driver: ClassVar[str] = "drivers.cia402.device:open_axis"
    mock: ClassVar[MockPort | None] = MockPort("mock_devices.cia402.mock:neutral", "axis_cia402", "slcan")
    advice: ClassVar[str] = (
        "its power, the CAN cable and its terminators, axis.port, axis.node, axis.bitrate and axis.eds"
    )
    patience: ClassVar[Mapping[str, Mapping[str, float]]] = {
        **CanAxisProduct.patience, "axis": {**CanAxisProduct.patience["axis"], "heartbeat_ms": 200},
    }  # fmt: skip

    product: Literal["cia402"] = Field(default="cia402", description="what stands on the bench")
    increments_per_mm: float = Field(
        default=0.0, ge=0, description="position units of the drive; 0: as its own unit, or factors and lead_mm, say"
    )
    increments_per_rev: float = Field(
        default=0.0, ge=0, description="position units a turn, where speeds are in rpm; 0: as the drive's factors say"
    )
    eds: Path | None = Field(default=None, description="its electronic data sheet; absent: that of the simulated one")
    lead_mm: float = Field(default=0.0, ge=0, description="travel of one turn of the driving shaft; 0: not compared")
    speed_unit: Literal["auto", "units/s", "rpm"] = Field(
        default="auto", description="unit of speed; auto: what object 60A9 says, position units/s without it"
    )
    referenced_bit: int = Field(
        default=-1, ge=-1, le=15, description="of the statusword, where the maker has one; -1: home in each session"
    )

    @property
    def homes_outward(self) -> bool:
        """Whether the search for the reference begins away from the tissue."""
        return self.homing_method in OUTWARD[self.direction]
