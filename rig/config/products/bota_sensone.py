"""Bota SensONE, a force sensor on a serial line."""

from typing import ClassVar, Literal

from pydantic import Field

from rig.config.products.roles import ForceProduct, MockPort


class BotaWiring(ForceProduct):
    """A Bota SensONE on a serial line."""

    driver: ClassVar[str] = "drivers.bota.device:open_sensor"
    mock: ClassVar[MockPort | None] = MockPort("mock_devices.devices:DeviceFactory.bota", "force")
    advice: ClassVar[str] = "its power, the cable, force.port, and the baud it is set to (460800 as delivered)"
    # Its variants differ: what the simulated one has; yours has a data sheet.
    range_N: ClassVar[float] = 100.0
    range_N_m: ClassVar[float] = 5.0

    product: Literal["bota-sensone"] = Field(default="bota-sensone", description="what stands on the bench")
