"""Robotiq FT 300, a force sensor on a serial line."""

from typing import ClassVar, Literal

from pydantic import Field

from rig.config.products.roles import ForceProduct, MockPort

STREAM_HZ = 100.0


class Ft300Wiring(ForceProduct):
    """A Robotiq FT 300 on a serial line; its rate is fixed."""

    driver: ClassVar[str] = "drivers.robotiq.device:open_sensor"
    mock: ClassVar[MockPort | None] = MockPort("mock_devices.devices:DeviceFactory.robotiq", "force_modbus")
    advice: ClassVar[str] = "its 24 V, the RS-485 adapter, force.port, and that no other program talks Modbus to it"
    # The maker's manual of the FT 300.
    range_N: ClassVar[float] = 300.0
    range_N_m: ClassVar[float] = 30.0

    product: Literal["robotiq-ft300"] = Field(default="robotiq-ft300", description="what stands on the bench")
    baud: Literal[0, 19200] = Field(default=0, description="it talks at 19200 only")
    rate_Hz: float = Field(default=1000, ge=0.99 * STREAM_HZ, le=1010, description="it gives 100")

    @property
    def sampled_Hz(self) -> float:
        """What it streams, whatever is asked for."""
        return STREAM_HZ
