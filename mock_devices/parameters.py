"""What the simulated bench is made of: one TOML file, every value with its unit, every default here.

`default.toml` beside this file lists all of them with comments; a file of your own needs only what differs.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator

from rig.config.table import Table, load

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Vector = tuple[float, float, float]


class Axis(Table):
    """Motor, ball screw and carriage as one mass, under the drive's position loop."""

    node: int = Field(default=1, ge=1, le=127, description="CANopen node of the drive")
    increments_per_mm: float = Field(default=2000.0, description="negative where they shrink into the tissue")
    lead_mm: Positive = Field(default=5.0, description="travel of one turn of the screw")
    mass_kg: Positive = Field(default=8.0, description="carriage and reflected rotor inertia")
    viscous_N_s_mm: NotNegative = 0.05
    coulomb_N: NotNegative = Field(
        default=3.0, description="dry friction of screw and carriage, seen by the drive only"
    )
    force_per_current_N_A: Positive = Field(default=41.7, description="36.9 mN m/A on a 5 mm lead, 90 % efficiency")
    current_limit_A: Positive = 5.0
    brake_N: NotNegative = 400.0
    brake_delay_s: NotNegative = Field(default=0.015, description="from power off to a closed brake")
    travel_min_mm: float = Field(default=-3.0, description="mechanical stop behind the reference switch at 0")
    travel_max_mm: float = 70.0
    start_mm: float = Field(default=5.0, description="where the carriage stands when the bench starts")
    position_gain_per_s: Positive = 120.0
    velocity_gain_per_s: Positive = Field(default=480.0, description="four times the position gain is critical damping")
    integral_gain_per_s2: NotNegative = 1500.0
    velocity_feed_forward: Share = 1.0
    acceleration_feed_forward: Share = 1.0
    interpolation_s: Positive = Field(default=0.001, description="time over which the drive goes to a new set-point")
    smoothing_s: Positive = Field(default=0.003, description="time constant of each of its two set-point filters")

    @field_validator("increments_per_mm")
    @classmethod
    def _counts(cls, increments_per_mm: float) -> float:
        if not increments_per_mm:
            raise ValueError("must not be 0")
        return increments_per_mm


class Tissue(Table):
    """The limb under the tip: F = scale a x exp(b x) + B v, never negative, nothing in the air; an inclusion adds."""

    a_N_mm: NotNegative = 0.12
    b_per_mm: float = Field(default=0.22, ge=0, le=2)
    damping_N_s_mm: float = Field(default=0.01, ge=0, le=1)
    stiffness_scale: NotNegative = 1.0
    inclusion_mm: NotNegative = Field(default=4.0, description="depth at which something stiff begins")
    inclusion_N_mm: NotNegative = Field(default=0.0, description="what it adds per millimetre; 0: there is none")
    present: bool = True


class Surface(Table):
    """Where the limb is."""

    position_mm: float = Field(default=20.0, description="axis position at which the tip touches")
    speed_mm_s: Positive = Field(default=50.0, description="how fast the limb goes to a new position")


class Sensor(Table):
    """A force sensor: six channels Fx Fy Fz Mx My Mz in its own frame."""

    axis: Literal["fx", "fy", "fz"] = Field(default="fz", description="channel that lies along the tip")
    compression: Literal["positive", "negative"] = "negative"
    gain: NotNegative = Field(default=1.0, description="what all channels show of a load, as a factor")
    zero_N: Vector = (0.21, -0.14, 0.8)
    zero_N_m: Vector = (0.004, -0.011, 0.002)
    noise_N: NotNegative = Field(default=0.005, description="rms of each sample, white")
    noise_N_m: NotNegative = 0.0002
    quantum_N: NotNegative = Field(default=0.001, description="step of the converter; 0: none")
    quantum_N_m: NotNegative = 0.00001
    range_N: Positive = 100.0
    range_N_m: Positive = 5.0
    crosstalk: NotNegative = Field(
        default=0.004, description="share of the axial force on the two other force channels"
    )
    lever_mm: float = Field(default=1.5, description="the tip's distance from the sensor's axis")
    filter_s: NotNegative = Field(default=0.0005, description="time constant of the sensor's own filter")
    temperature_C: float = 25.0
    warm_up_K: float = Field(default=4.0, description="rise after power-on")
    warm_up_s: Positive = 300.0
    counter_drift_ppm: float = Field(default=25.0, ge=-1000, le=1000, description="how fast its counter runs too fast")


class Camera(Table):
    """The marker tracker: tool 0 rides on the tip, tool 1 on the limb."""

    latency_s: float = Field(default=0.015, ge=0, le=0.5)
    noise_mm: NotNegative = Field(default=0.06, description="rms of each coordinate of each frame")
    noise_deg: NotNegative = 0.05
    error_mm: NotNegative = Field(default=0.15, description="mean of the fit error the camera reports")
    direction: Vector = Field(default=(0.12, 0.25, -0.9608), description="the axis in the camera's frame; any length")
    tip_origin_mm: Vector = Field(default=(35.0, -60.0, -1400.0), description="tool tip with the axis at 0")
    arm_origin_mm: Vector = Field(default=(95.0, -40.0, -1405.0), description="tool arm with the surface at 0")
    tip_in_view: bool = True
    arm_in_view: bool = True
    tcp_port: int = Field(default=8765, ge=0, le=65535, description="taken where it is free; 0: any")

    @field_validator("direction")
    @classmethod
    def _points_somewhere(cls, direction: Vector) -> Vector:
        if not any(direction):
            raise ValueError("must not be the zero vector")
        return direction


class Parameters(Table):
    """The whole bench. ``hide`` switches on effects by name: ``[hide.friction]`` ``level_N = 0.2``."""

    axis: Axis = Axis()
    tissue: Tissue = Tissue()
    surface: Surface = Surface()
    force: Sensor = Sensor()
    force_modbus: Sensor = Sensor(
        zero_N=(-0.4, 0.3, 1.7), noise_N=0.05, noise_N_m=0.002, quantum_N=0.01, quantum_N_m=0.001,
        range_N=300.0, range_N_m=30.0, filter_s=0.003,
    )  # fmt: skip
    tracker: Camera = Camera()
    hide: dict[str, dict[str, float]] = Field(default_factory=dict)


def load_parameters(path: Path | None) -> Parameters:
    """The bench described in ``path``, or the default one; raises UsageError naming file, key and nearest key."""
    return Parameters() if path is None else load(Parameters, path)
