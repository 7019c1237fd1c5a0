"""Who may approach: no program with an approach without a force calibration that belongs to the sensor that answers.

A configuration that contradicts a calibration is refused; nothing is ever corrected by the difference.
"""

from datetime import datetime

from controller.commissioning.axis import as_answered
from controller.commissioning.dynamics_refusals import dynamics_reasons, foreign
from controller.loop.steps import Approach, Program
from drivers.roles import Identity
from rig.config.calibration import AxisCalibration
from rig.config.products.roles import MOCK_PORT
from rig.config.wiring import Wiring
from rig.errors import UsageError

# Counts of the encoder to the millimetre are a whole number or a short decimal; this allows for its last digit.
SAME_SCALE = 1e-6


def refuse_uncommissioned(program: Program, wiring: Wiring, sensor: Identity, axis: Identity, now: datetime) -> None:
    """Raises UsageError where ``program`` approaches and a calibration is missing, foreign, unfit or contradicted."""
    if not any(isinstance(step, Approach) for step in program.steps):
        return
    known = wiring.calibration
    if known.of_force is None:
        raise UsageError(f"{program.name} refused before moving: {_missing(f'{sensor.product} {sensor.serial}')}")
    answered = wiring.model_copy(update={"axis": as_answered(wiring.axis, axis)})
    reasons = [*foreign(known.of_force, sensor), *contradictions(answered), *known.unfit(now)]
    if known.of_axis:
        reasons += foreign(known.of_axis, axis)
    reasons += dynamics_reasons(program, wiring, axis)
    if reasons:
        raise UsageError(f"{program.name} refused before moving: " + "; ".join(reasons))


def refuse_uncalibrated(wiring: Wiring, now: datetime) -> None:
    """The same as far as it is known before a device is opened; raises UsageError. A mock sensor calibrates itself."""
    reasons = [*contradictions(wiring), *wiring.calibration.unfit(now)]
    if wiring.calibration.of_force is None and wiring.force.port != MOCK_PORT:
        reasons.append(_missing(f"the sensor at {wiring.force.port}"))
    if reasons:
        raise UsageError("; ".join(reasons))


def refuse_unstated_scale(wiring: Wiring) -> None:
    """Raises UsageError where a real axis would go by a scale that nobody stated, neither person, product nor drive."""
    axis = wiring.axis
    if axis.port != MOCK_PORT and axis.scale_unstated:
        raise UsageError(
            f"axis.increments_per_mm is not stated for the {axis.product} at {axis.port}: give the increments of 1 mm"
            " of the tip, encoder, gear and screw included, then check it with `rig calibrate axis`; what was used so"
            f" far is `axis.increments_per_mm = {axis.increments_per_mm:g}`"
        )


def contradictions(wiring: Wiring) -> list[str]:
    """Words of the wiring that say something else than the calibrations, one sentence each."""
    found = []
    force, axis, known = wiring.force, wiring.axis, wiring.calibration
    if known.of_force and (force.axis, force.compression) != (known.of_force.channel, known.of_force.compression):
        found.append(
            f"force.axis {force.axis}, force.compression {force.compression}: the calibration found compression"
            f" {known.of_force.compression} on {known.of_force.channel}; correct the wiring, or calibrate again"
        )
    if known.of_axis and not _same_scale(wiring, known.of_axis):
        found.append(
            f"axis.increments_per_mm {axis.increments_per_mm:g}, axis.direction {axis.direction}: the axis was"
            f" calibrated with {known.of_axis.increments_per_mm:g} and {known.of_axis.direction};"
            " correct the wiring, or calibrate again"
        )
    return found


def _same_scale(wiring: Wiring, known: AxisCalibration) -> bool:
    counted = wiring.axis.increments_per_mm or known.increments_per_mm  # what only the drive says is known from it
    return wiring.axis.direction == known.direction and abs(counted / known.increments_per_mm - 1) <= SAME_SCALE


def _missing(whose: str) -> str:
    return f"no force calibration of {whose}: run `rig calibrate force` and give its file as calibration.force"
