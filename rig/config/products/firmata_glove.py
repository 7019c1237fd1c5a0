"""A pain glove: force sensors under finger tips, on analogue inputs of a microcontroller with StandardFirmata."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from rig.config.glove import GloveCalibration
from rig.config.products.input_role import InputProduct, channel_trouble
from rig.config.products.roles import MockPort
from rig.input_streams import InputChannel

# Analogue inputs have four bits in a Firmata message.
MOST_PINS = 16


class FirmataGlove(InputProduct):
    """A pain glove on a microcontroller with StandardFirmata."""

    driver: ClassVar[str] = "drivers.firmata.device:open_glove"
    mock: ClassVar[MockPort | None] = MockPort("mock_devices.inputs:glove", "glove")
    advice: ClassVar[str] = "its USB cable, its port, and that StandardFirmata is on the board"

    usb: ClassVar[tuple[str, ...]] = ("2341:0043",)  # Arduino Uno

    product: Literal["firmata-glove"] = Field(default="firmata-glove", description="what it is")
    fingers: Mapping[str, Annotated[int, Field(ge=0, lt=MOST_PINS)]] = Field(
        default={"thumb": 0, "index": 1, "middle": 2}, description="analogue input of each force sensor"
    )
    interval_ms: int = Field(
        default=20, ge=10, le=1000, description="from sample to sample; the firmware takes no less than 10"
    )
    calibration: Path | None = Field(
        default=None, description="file that `rig calibrate glove` wrote; without one forces are not known"
    )
    of_fingers: GloveCalibration | None = Field(default=None, description="what that file holds; do not write it here")

    @property
    def channels(self) -> tuple[InputChannel, ...]:
        """Of each finger its force, and the counts that it comes from."""
        forces = (InputChannel(f"{name}_N", "N", f"force under {name}, by the calibration") for name in self.fingers)
        counts = (InputChannel(f"{name}_counts", "1", f"reading of the {name}'s converter") for name in self.fingers)
        return *forces, *counts

    @property
    def nominal_Hz(self) -> float:
        """By the sampling interval."""
        return 1000.0 / self.interval_ms

    @model_validator(mode="after")
    def _sound(self) -> Self:
        pins = list(self.fingers.values())
        if len(set(pins)) < len(pins):
            raise ValueError("fingers: two force sensors on one analogue input; give each its own")
        if trouble := channel_trouble(self.channels):
            raise ValueError(f"fingers: {trouble}")
        return self
