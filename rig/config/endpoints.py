"""What the simulated bench prints when it is ready: where each device is, and what else commands need of it."""

from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict, Field


class Endpoints(BaseModel):
    """Beside these keys stands the address of each device, by role and kind of port.

    ``serials`` has the serial number of force sensors and axis by role. ``latency_ms`` is what a data sheet would say
    of each device; what is hidden in the bench comes on top.
    """

    model_config = ConfigDict(frozen=True, extra="allow")
    __pydantic_extra__: dict[str, dict[str, str]] = Field(init=False)

    control: str
    pid: int
    serials: Mapping[str, str]
    latency_ms: Mapping[str, float]

    @property
    def devices(self) -> Mapping[str, Mapping[str, str]]:
        """Addresses by role and kind of port."""
        return self.__pydantic_extra__
