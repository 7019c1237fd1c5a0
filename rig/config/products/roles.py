"""The roles on the bench, and what a product declares to fill one.

A product is one class in one file: its table in `rig.toml`, and beside it what everything else is derived from. Driver
and mock are named as ``module:object``, because they belong to packages that are not imported here.
"""

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field

from rig.config.endpoints import Endpoints
from rig.config.maxima import Maximum
from rig.config.table import Table

Positive = Annotated[float, Field(gt=0)]
MOCK_PORT = "mock"


class MockPort(NamedTuple):
    """Where the simulated bench serves a product: by ``role`` and ``kind`` among its endpoints, behind ``scheme``.

    ``maker`` builds it: a function of `mock_devices.devices.DeviceFactory` that returns the devices.
    """

    maker: str
    role: str
    kind: str = "serial"
    scheme: str = ""

    def address(self, endpoints: Endpoints) -> str:
        """The port that takes the place of `mock`, of the ``endpoints`` that the bench printed."""
        return f"{self.scheme}{endpoints.devices[self.role][self.kind]}"


class Product(Table):
    """What every product declares.

    ``driver`` is called with the product's table (an axis: also with Limits, rate_Hz, interrupted) and returns what
    `drivers.roles` asks of the role. ``advice`` is what to look at where it does not answer. ``patience`` is what a
    simulated one needs of other keys of `rig.toml` on a busy computer, where these do not say.
    """

    driver: ClassVar[str]
    advice: ClassVar[str]
    mock: ClassVar[MockPort | None] = None
    patience: ClassVar[Mapping[str, Mapping[str, float]]] = {}
    # USB ids, as 2341:0043, behind which it stands and few others do: `rig find` asks there for nothing else of ours.
    usb: ClassVar[tuple[str, ...]] = ()

    product: str = ""
    port: str = Field(default=MOCK_PORT, description="where it is plugged in; mock: the simulated bench serves it")

    @property
    def promised_Hz(self) -> float | None:
        """Samples a second that come by themselves; None where they answer what is asked, or are irregular."""
        return None

    @property
    def maxima(self) -> tuple[Maximum, ...]:
        """What the product adds to the maxima of every configuration."""
        return ()


class ForceProduct(Product):
    """A force sensor. Beyond ``range_N`` and ``range_N_m`` a channel measures nothing."""

    range_N: ClassVar[float]
    range_N_m: ClassVar[float]
    # What it measures of these; the others are 0 in its samples.
    channels: ClassVar[tuple[str, ...]] = ("fx", "fy", "fz", "mx", "my", "mz")
    # A simulated device is one more process of a busy computer: without real-time priority it may come a few tenths of
    # a second late where a real one does not. An axis that stands still for 400 ms falls behind by 12 mm at 30 mm/s.
    patience: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "loop": {"missed_periods": 0, "stale_force_ms": 400.0, "overrun_ms": 400.0}
    }

    baud: int = Field(default=0, ge=0, description="0: the product's own default")
    rate_Hz: float = Field(default=1000, ge=10, le=1010, description="samples a second")
    axis: Literal["fx", "fy", "fz"] = Field(default="fz", description="channel that lies along the tip")
    compression: Literal["positive", "negative"] = Field(
        default="negative", description="sign the sensor gives to compression"
    )
    latency_ms: float = Field(default=0.0, ge=0, le=100, description="known smallest delay from capture to arrival")

    @property
    def sampled_Hz(self) -> float:
        """Samples a second that really come."""
        return self.rate_Hz

    @property
    def promised_Hz(self) -> float:
        """As sampled."""
        return self.sampled_Hz

    @property
    def maxima(self) -> tuple[Maximum, ...]:
        """A limit beyond what the sensor can measure is none."""
        reason = f"a {self.product} measures no more"
        return (
            Maximum("limits.force_N", self.range_N, "N", reason),
            Maximum("limits.torque_N_m", self.range_N_m, "N m", reason),
        )


class AxisProduct(Product):
    """A servo axis."""

    patience: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "loop": {"stale_axis_ms": 400.0, "overrun_ms": 400.0},
        "axis": {"following_error_mm": 12.0},
    }

    increments_per_mm: Positive = Field(default=2000.0, description="of the encoder, gear and screw included")
    direction: Literal[1, -1] = Field(default=1, description="1: increments grow into the tissue")
    homing_speed_mm_s: Positive = Field(default=20.0, description="at which the reference is searched")
    following_error_mm: Positive = Field(default=2.0, description="lag behind the set-point that stops motion")
    standstill_mm: Positive = Field(
        default=0.3, description="how far the set-point may go while ten reports of the axis name the same place"
    )
    acceleration_mm_s2: Positive = Field(default=2000.0, description="of every move, and of the stop")
    bandwidth_Hz: Positive = Field(default=34.0, description="-3 dB of the drive's position loop, for the gains")
    holds_unpowered: bool = Field(
        default=True, description="a brake or a self-locking screw: without power a limb cannot push it back"
    )
    delay_ms: float = Field(default=4.0, ge=0, description="from command to motion, sensor included")

    @property
    def scale_unstated(self) -> bool:
        """Whether it would go by a usual scale that neither a person nor its product stated."""
        usual = AxisProduct.model_fields["increments_per_mm"].default
        return self.increments_per_mm == usual and "increments_per_mm" not in self.model_fields_set

    @property
    def reports_Hz(self) -> float:
        """The most positions a second that it gives, however often it is asked."""
        return math.inf

    @property
    def homes_outward(self) -> bool:
        """Whether the search for the reference leads out of the tissue; False where that is not known."""
        return False


class TrackerProduct(Product):
    """A marker tracker; leave the table out where there is none."""

    patience: ClassVar[Mapping[str, Mapping[str, float]]] = {"loop": {"stale_marker_ms": 500.0}}

    tools: tuple[str, ...] = Field(
        default=("tip", "arm"), min_length=1, description="names of the markers, that on the tip first"
    )
    rate_Hz: Positive = Field(default=60.0, description="frames a second")
    latency_ms: float = Field(default=0.0, ge=0, le=200, description="known smallest delay from capture to arrival")

    @property
    def promised_Hz(self) -> float:
        """Frames a second."""
        return self.rate_Hz
