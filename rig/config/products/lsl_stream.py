"""A physiological stream by Lab Streaming Layer: heart rate, respiration and what else a laboratory records so."""

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from rig.config.products.input_role import InputProduct, channel_trouble
from rig.config.products.roles import MockPort
from rig.input_streams import InputChannel


class LslStream(InputProduct):
    """A stream by Lab Streaming Layer; its port is the stream's name."""

    driver: ClassVar[str] = "drivers.lsl.device:open_stream"
    mock: ClassVar[MockPort | None] = MockPort("mock_devices.inputs:breathing", "breathing", "lsl")
    advice: ClassVar[str] = "whether its program sends, its port (the stream's name), and input.NAME.scope"
    at_line: ClassVar[bool] = False

    product: Literal["lsl-stream"] = Field(default="lsl-stream", description="what it is")
    source_id: str = Field(default="", description="tells streams of one name apart; empty: there is one of that name")
    scope: Literal["machine", "link", "site"] = Field(
        default="machine", description="how far streams are looked for: this computer, its network segment, the site"
    )
    units: Mapping[str, str] = Field(
        default={"respiration": "mm"}, description="unit of each channel by its name, in the stream's own order"
    )
    rate_Hz: float = Field(default=50.0, ge=0, le=5000, description="samples a second; 0: they come when they come")
    silent_s: float = Field(
        default=2.0, gt=0, le=60, description="without a sample for so long it is lost, where it has a rate"
    )

    @property
    def channels(self) -> tuple[InputChannel, ...]:
        """As the table names them."""
        return tuple(InputChannel(name, unit, f"{name} as the sender gives it") for name, unit in self.units.items())

    @property
    def nominal_Hz(self) -> float:
        """As the table states it."""
        return self.rate_Hz

    @property
    def place(self) -> str:
        """Two streams of one name differ in their source."""
        return f"lsl {self.port} {self.source_id}".rstrip()

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if trouble := channel_trouble(self.channels):
            raise ValueError(f"units: {trouble}")
        return self
