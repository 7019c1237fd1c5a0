"""What no configuration may exceed: each maximum with its source. A bench that needs more is another bench."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple


class Maximum(NamedTuple):
    """The largest value of one key of `rig.toml`, and why."""

    key: str
    value: float
    unit: str
    reason: str


# 180 N/cm2 on 0.28 cm2 are 51 N.
_PRESSURE = "ISO/TS 15066:2016, Table A.2, allows the forearm 180 N/cm2 at rest, which a tip of 6 mm reaches at 51 N"
_WAY = "a second without news of the axis is 30 mm at the 30 mm/s of a fast trial"
_OPEN = "0.75 N of 15 N, half of what a peak may have above them"

MAXIMA: tuple[Maximum, ...] = (
    Maximum("limits.force_N", 50.0, "N", _PRESSURE),
    Maximum("subject.pain_threshold_N", 50.0, "N", _PRESSURE),
    Maximum("limits.torque_N_m", 5.0, "N m", "50 N, the largest force, 0.1 m in front of the sensor"),
    Maximum("limits.force_rate_N_s", 5000.0, "N/s", "above it, force passes 50 N in the 10 ms that a rate takes"),
    Maximum("limits.pushed_N", 15.0, "N", "the default pain threshold: a limb that pushes has nobody who stops it"),
    Maximum("limits.depth_mm", 30.0, "mm", "half the thickness of a slender forearm, 60 mm"),
    Maximum("limits.speed_mm_s", 100.0, "mm/s", "a person needs 0.2 s to press a button, in which that is 20 mm"),
    Maximum("limits.patient_mm", 30.0, "mm", "half the width of a slender forearm: the tip is not above it any more"),
    Maximum("limits.position_max_mm", 500.0, "mm", "no axis of a bench for one limb is longer"),
    Maximum("limits.search_to_mm", 500.0, "mm", "no axis of a bench for one limb is longer: its end ends a search"),
    Maximum("axis.following_error_mm", 30.0, "mm", _WAY),
    Maximum("axis.standstill_mm", 3.0, "mm", "ten reports of an axis asked 100 times a second, at 30 mm/s"),
    Maximum("axis.acceleration_mm_s2", 10_000.0, "mm/s2", "a third of what 5 A give a carriage of 8 kg, 26 m/s2"),
    Maximum("axis.homing_speed_mm_s", 50.0, "mm/s", "the drive homes by itself, without a look at the force"),
    Maximum("loop.stale_force_ms", 1000.0, "ms", _WAY),
    Maximum("loop.stale_axis_ms", 1000.0, "ms", _WAY),
    Maximum("loop.stale_marker_ms", 2000.0, "ms", "half a breath: a limb unseen for longer may lie elsewhere"),
    Maximum("loop.overrun_ms", 1000.0, "ms", _WAY),
    Maximum("loop.missed_periods", 10.0, "periods", "0.1 s at 100 Hz, in which a fast trial goes 3 mm"),
    Maximum("loop.lease_s", 10.0, "s", "longer is somebody who has left, not a program that is slow"),
    Maximum("calibration.max_age_days", 730.0, "days", "makers of force sensors ask for a calibration each year"),
    Maximum("calibration.max_uncertainty", 0.05, "of the value", _OPEN),
)


def beyond(tables: Mapping[str, object], of_products: Iterable[Maximum]) -> list[str]:
    """What of ``tables`` (section to table) is above its maximum, the products' own included, one sentence each."""
    found = []
    least = {maximum.key: maximum for maximum in sorted((*of_products, *MAXIMA), key=lambda one: -one.value)}
    for key, value, unit, reason in least.values():
        section, _, name = key.partition(".")
        given = getattr(tables[section], name)
        if not given <= value:
            found.append(f"{key} {given:g} {unit} is above its maximum, {value:g} {unit}: {reason}")
    return found
