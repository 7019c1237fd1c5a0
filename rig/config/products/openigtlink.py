"""OpenIGTLink: a tracker behind any program that speaks it, PLUS for one, over TCP."""

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from rig.config.products.roles import MockPort, TrackerProduct

LONGEST_NAME = 20  # bytes of a device name in the protocol's header


class OpenIgtLinkWiring(TrackerProduct):
    """A tracker behind an OpenIGTLink server, `tcp://host:18944`."""

    driver: ClassVar[str] = "drivers.openigtlink.device:open_tracker"
    mock: ClassVar[MockPort | None] = MockPort(
        "mock_devices.openigtlink.factory:openigtlink", "tracker_igtl", "tcp", "tcp://"
    )
    advice: ClassVar[str] = "that the server runs and tracks, tracker.port, tracker.tools and tracker.stream"

    product: Literal["openigtlink"] = Field(default="openigtlink", description="what stands on the bench")
    stream: Literal["TRANSFORM", "TDATA"] = Field(
        default="TRANSFORM", description="what the server sends by itself, or tracking data that it is asked for"
    )
    version: Literal[1, 2, 3] = Field(default=3, description="of the protocol, in what is asked; any is understood")

    @model_validator(mode="after")
    def _names_fit(self) -> "OpenIgtLinkWiring":
        long = [tool for tool in self.tools if len(tool.encode()) > LONGEST_NAME]
        if long:
            raise ValueError(f"tools: {long[0]!r} is longer than the {LONGEST_NAME} bytes of an OpenIGTLink name")
        return self
