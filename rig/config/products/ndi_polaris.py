"""NDI Polaris, a marker tracker on a serial line or a network."""

from pathlib import Path
from typing import ClassVar, Literal

from pydantic import Field

from rig.config.products.roles import MockPort, TrackerProduct


class PolarisWiring(TrackerProduct):
    """An NDI Polaris on a serial line or, as `tcp://host:8765`, a Vega on the network."""

    driver: ClassVar[str] = "drivers.ndi.device:open_tracker"
    mock: ClassVar[MockPort | None] = MockPort("mock_devices.devices:DeviceFactory.ndi", "tracker", "tcp", "tcp://")
    advice: ClassVar[str] = "its power and warm-up, the cable or network address, tracker.port, and tracker.roms"

    product: Literal["ndi-polaris"] = Field(default="ndi-polaris", description="what stands on the bench")
    reply: Literal["BX", "TX"] = Field(default="BX", description="binary or text")
    roms: tuple[Path, ...] = Field(default=(), description="one .rom file a tool; empty: tools already in ports")
