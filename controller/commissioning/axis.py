"""The axis against a reference: scale and sense, or one sentence why they are not as configured.

A tracker sees along which line the tip goes and how far. Which way along it leads into the limb it cannot see of the
tip alone: a marker on the limb, in front of the tip, says it; else only who stands there, or a contact. A gauge block
says both: the tip touches the table and the block on it, and what moved it there is a growing position.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drivers.roles import Identity
from rig.config.calibration import LARGEST_SCALE_ERROR, AxisCalibration, AxisStep
from rig.config.products.roles import AxisProduct
from rig.errors import CheckFailed
from rig.recording.slope import COVERAGE, slope_of

# Seen with the first step, before the axis goes on: twice or half the way is no matter of noise.
LARGEST_FIRST_ERROR = 0.2
# A marker lies on the skin beside the tip; less than this in front of it may be its own height.
LEAST_AHEAD_MM = 5.0
Array = NDArray[np.float64]
KnownBy = Literal["limb marker", "operator", "contact"]


@dataclass(frozen=True)
class Place:
    """One rest of the axis: where it said it was, and where the markers were seen, shapes (frames, 3)."""

    axis_mm: float
    tip_mm: Array
    arm_mm: Array


def as_answered(config: AxisProduct, drive: Identity) -> AxisProduct:
    """The axis with the scale that its drive said when it was opened, where the configuration states none."""
    said = {"increments_per_mm": float(drive.settings.get("increments_per_mm", 0.0))}
    return config if config.increments_per_mm else config.model_copy(update=said)


def refuse_first_step(start: Place, now: Place) -> None:
    """Raises CheckFailed where the first step already went much too far or not far enough."""
    asked_mm = abs(now.axis_mm - start.axis_mm)
    moved_mm = float(np.linalg.norm(now.tip_mm.mean(axis=0) - start.tip_mm.mean(axis=0)))
    if abs(moved_mm / asked_mm - 1) > LARGEST_FIRST_ERROR:
        raise CheckFailed(
            f"the axis says it went {asked_mm:.3g} mm and the tracker saw {moved_mm:.3g} mm: check"
            " axis.increments_per_mm, the gear, and that tool 0 is the marker on the tip"
        )


def ahead_mm(places: Sequence[Place]) -> float | None:
    """How far in front of the tip the limb's marker is, as the position grows; None where it was hidden."""
    seen = [place for place in places if len(place.arm_mm)]
    if not seen or len(places) < 2:
        return None
    low, high = min(places, key=lambda place: place.axis_mm), max(places, key=lambda place: place.axis_mm)
    way = high.tip_mm.mean(axis=0) - low.tip_mm.mean(axis=0)
    direction = way / np.linalg.norm(way)
    return float((seen[0].arm_mm.mean(axis=0) - seen[0].tip_mm.mean(axis=0)) @ direction)


def known_direction(ahead: float | None) -> KnownBy | None:
    """Who knows that a growing position leads to the limb; None where it has to be asked. Raises CheckFailed."""
    if ahead is None or abs(ahead) < LEAST_AHEAD_MM:
        return None
    if ahead < 0:
        raise CheckFailed(
            f"the tip goes away from the limb's marker, which lies {-ahead:.0f} mm behind it, where the position grows:"
            " axis.direction is wrong, or the markers are exchanged"
        )
    return "limb marker"


def against_tracker(
    drive: Identity, config: AxisProduct, places: Sequence[Place], known_by: KnownBy, now: datetime
) -> AxisCalibration:
    """The calibration that rests of the axis and the tip's marker give; raises CheckFailed where the scale is off."""
    frames = np.concatenate([place.tip_mm for place in places])
    positions = np.concatenate([np.full(len(place.tip_mm), place.axis_mm) for place in places])
    found = slope_of(positions, np.zeros(len(positions)), frames)
    if found is None:
        raise CheckFailed(f"the tip's marker was seen in {len(frames)} frames only: bring it into the tracker's view")
    origin = places[0].tip_mm.mean(axis=0)
    steps = [
        AxisStep(
            axis_mm=place.axis_mm - places[0].axis_mm,
            reference_mm=float((place.tip_mm.mean(axis=0) - origin) @ found.direction),
        )
        for place in places
    ]
    return _calibration(drive, config, found.slope, found.deviation, steps, "tracker", known_by, now)


def against_block(
    drive: Identity,
    config: AxisProduct,
    table_mm: Sequence[float],
    block_mm: Sequence[float],
    gauge_mm: float,
    now: datetime,
) -> AxisCalibration:
    """The calibration that positions at contact with the table, and with a block of ``gauge_mm`` on it, give."""
    table, block = float(np.mean(table_mm)), float(np.mean(block_mm))
    if table <= block:
        raise CheckFailed(
            f"the table was touched at {table:.3f} mm and the block on it at {block:.3f} mm, not before it:"
            " was the block under the tip?"
        )
    scale = gauge_mm / (table - block)
    scatter_mm = math.hypot(*(float(np.std(found, ddof=1)) / math.sqrt(len(found)) for found in (table_mm, block_mm)))
    steps = [AxisStep(axis_mm=0.0, reference_mm=0.0), AxisStep(axis_mm=table - block, reference_mm=gauge_mm)]
    deviation = scale * scatter_mm / (table - block)
    return _calibration(drive, config, scale, deviation, steps, "gauge block", "contact", now)


def _calibration(
    drive: Identity,
    config: AxisProduct,
    scale: float,
    deviation: float,
    steps: Sequence[AxisStep],
    reference: Literal["tracker", "gauge block"],
    known_by: KnownBy,
    now: datetime,
) -> AxisCalibration:
    _refuse_scale(scale, deviation, reference)
    return AxisCalibration(
        product=drive.product,
        serial=drive.serial,
        date=now,
        scale=scale,
        uncertainty=deviation,
        direction=config.direction,
        direction_known_by=known_by,
        increments_per_mm=as_answered(config, drive).increments_per_mm,
        reference=reference,
        steps=tuple(steps),
    )


def _refuse_scale(scale: float, deviation: float, reference: str) -> None:
    """The whole 95 % interval must lie within the limit: what is not known well enough is not calibrated."""
    low, high = scale - COVERAGE * deviation, scale + COVERAGE * deviation
    if max(abs(low - 1), abs(high - 1)) > LARGEST_SCALE_ERROR:
        raise CheckFailed(
            f"a millimetre of the axis is {scale:.4f} mm of the {reference} (95 %: {low:.4f} to {high:.4f}, limit 1 +-"
            f" {LARGEST_SCALE_ERROR:g}): check axis.increments_per_mm and the gear; where the interval is wide, the"
            " reference and how it is fastened"
        )
