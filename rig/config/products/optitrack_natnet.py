"""OptiTrack cameras: what Motive streams by NatNet, in unicast."""

import re
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from rig.config.products.roles import MockPort, Positive, TrackerProduct

_TOOL = re.compile(r"[^/]+(/\d{1,5})?")


class NatNetWiring(TrackerProduct):
    """Motive with OptiTrack cameras, at `udp://host:1510`. A tool is a rigid body, or one marker of it as `Body/2`."""

    driver: ClassVar[str] = "drivers.optitrack.device:open_tracker"
    mock: ClassVar[MockPort | None] = MockPort(
        "mock_devices.optitrack.factory:optitrack", "tracker_natnet", "udp", "udp://"
    )
    advice: ClassVar[str] = "that Motive runs and streams in unicast, tracker.port, tracker.tools and the firewall"

    product: Literal["optitrack-natnet"] = Field(default="optitrack-natnet", description="what stands on the bench")
    rate_Hz: Positive = Field(default=120.0, description="frames a second, as Motive is set")

    @model_validator(mode="after")
    def _tools_are_bodies_or_markers(self) -> Self:
        wrong = [tool for tool in self.tools if not _TOOL.fullmatch(tool)]
        if wrong:
            raise ValueError(f"tools: {wrong[0]!r} is neither a rigid body nor one of its markers, as Body/2")
        return self
