"""`rig.toml`: which products stand on the bench, where they are plugged in, and what must never be exceeded."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self, TypeAlias

from pydantic import Field, model_validator

from rig.config.calibration import Calibration
from rig.config.force_map import UNIT, ForceMap
from rig.config.maxima import beyond
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.input_role import InputProduct, input_troubles
from rig.config.products.inputs import INPUTS
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.products.ndi_polaris import PolarisWiring
from rig.config.products.registry import AXES, FORCE_SENSORS, TRACKERS, choice_of
from rig.config.products.roles import MOCK_PORT, AxisProduct, ForceProduct, TrackerProduct
from rig.config.stop import Stop
from rig.config.subject import Subject
from rig.config.table import Table

Positive = Annotated[float, Field(gt=0)]
if TYPE_CHECKING:
    AnyForce: TypeAlias = ForceProduct
    AnyAxis: TypeAlias = AxisProduct
    AnyTracker: TypeAlias = TrackerProduct
    AnyInput: TypeAlias = InputProduct
else:
    AnyInput = choice_of(INPUTS)
    AnyForce, AnyAxis, AnyTracker = choice_of(FORCE_SENSORS), choice_of(AXES), choice_of(TRACKERS)


class Loop(Table):
    """The cyclic executive."""

    rate_Hz: float = Field(default=1000.0, ge=50, le=2000, description="cycles a second")
    priority: int = Field(default=50, ge=0, le=98, description="SCHED_FIFO priority asked for; 0: none")
    stale_force_ms: Positive = Field(default=50.0, description="age at which a force sample no longer counts")
    stale_axis_ms: Positive = Field(default=50.0, description="age at which an axis sample no longer counts")
    stale_marker_ms: Positive = Field(default=200.0, description="age at which a tracker frame no longer counts")
    missed_periods: int = Field(
        default=2,
        ge=0,
        description="force samples that may be missing, or the same, one after another; 0: only by stale_force_ms",
    )
    lease_s: float = Field(
        default=3.0, ge=0, description="the operator's program must show itself this often; 0: not asked"
    )
    overrun_ms: Positive = Field(default=100.0, description="a cycle that begins later than this stops motion")


class Limits(Table):
    """What stops motion; checked before it and during it."""

    force_N: Positive = Field(default=20.0, description="norm of the three force channels, from the reference zero")
    force_rate_N_s: Positive = Field(default=1000.0, description="how fast the force vector may change")
    # Friction of 0.3 under 15 N, 0.1 m in front of the sensor, gives 0.45 N m; more is a tip that is levered.
    torque_N_m: Positive = Field(default=0.5, description="norm of the sensor's moments, from the reference zero")
    # A third of the default pain threshold, and ten times the drift in the air that is accepted.
    pushed_N: Positive = Field(default=5.0, description="how much load may rise while the tip rests")
    when_pushed: Literal["retreat", "release"] = Field(
        default="retreat", description="at rest: away from the limb, or without power where a limb can push the axis"
    )
    depth_mm: Positive = Field(default=15.0, description="from the surface")
    position_min_mm: float = Field(default=0.0, ge=-500, description="end of the workspace away from the limb")
    position_max_mm: float = Field(default=60.0, description="end of the workspace towards the limb")
    search_to_mm: float = Field(
        default=40.0, description="axis position at which a run under force gives up the search for the limb"
    )
    patient_mm: Positive = Field(default=10.0, description="how far the limb may move against the robot in a program")
    speed_mm_s: Positive = Field(default=60.0, description="of the axis, in either direction")
    retract_speed_mm_s: Positive = Field(default=20.0, description="at which a stop brings the tip out")

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.position_min_mm >= self.position_max_mm:
            raise ValueError(
                f"position_min_mm {self.position_min_mm:g} is not below position_max_mm {self.position_max_mm:g}"
            )
        if self.retract_speed_mm_s > self.speed_mm_s:
            raise ValueError(f"retract_speed_mm_s {self.retract_speed_mm_s:g} is above speed_mm_s {self.speed_mm_s:g}")
        return self


class TipShape(Table):
    """What touches."""

    round: bool = Field(default=False, description="force begins without slope, as under a ball or a cone")


class MockBenchSettings(Table):
    """Where ports are ``mock``: what the simulated bench is made of."""

    parameters: Path | None = Field(
        default=None, description="TOML file of a simulated subject; absent: the built-in one"
    )
    hide: tuple[str, ...] = Field(default=(), description="effects hidden from the analysis, as friction.level_N=0.2")


class Wiring(Table):
    """The whole of `rig.toml`."""

    force: AnyForce = BotaWiring()
    axis: AnyAxis = Epos4Wiring()
    tracker: AnyTracker | None = PolarisWiring()
    loop: Loop = Loop()
    limits: Limits = Limits()
    tip: TipShape = TipShape()
    subject: Subject = Subject()
    stop: Stop = Stop()
    mock: MockBenchSettings = MockBenchSettings()
    calibration: Calibration = Calibration()
    input: Mapping[str, AnyInput] = Field(default={}, description="by name, which is that of its stream")

    @model_validator(mode="after")
    def _gives_way(self) -> Self:
        if self.limits.when_pushed == "release" and self.axis.holds_unpowered:
            raise ValueError(
                "limits.when_pushed release: axis.holds_unpowered says that a limb cannot push the axis back without"
                " power; use retreat, or say false where neither brake nor screw holds it"
            )
        return self

    @model_validator(mode="after")
    def _within_maxima(self) -> Self:
        largest = (*self.force.maxima, *self.axis.maxima)
        reasons = beyond(dict(self), largest) + input_troubles(self.input, self.stop.keypad)
        if reasons:
            raise ValueError("; ".join(reasons))
        return self

    @property
    def force_map(self) -> ForceMap:
        """From the sensor's readings to compression; without a calibration by the configured channel and sign alone."""
        known = self.calibration.of_force
        return ForceMap(self.force.axis, self.force.compression, known.matrix if known else UNIT)

    @property
    def force_limit_N(self) -> float:
        """The lower of machine limit and subject's pain threshold."""
        return min(self.limits.force_N, self.subject.threshold_N)

    @property
    def stale_force_ms(self) -> float:
        """Age at which a force sample no longer counts.

        A sample just in time is up to two periods old: one until the next is due, one on its way.
        """
        missed, limit_ms = self.loop.missed_periods, self.loop.stale_force_ms
        return min(limit_ms, (missed + 2) * 1000 / self.force.sampled_Hz) if missed else limit_ms

    @property
    def uses_mock(self) -> bool:
        """Whether any device is to be served by the mock bench."""
        devices = (self.force, self.axis, self.tracker, *self.input.values())
        return any(device is not None and device.port == MOCK_PORT for device in devices)
