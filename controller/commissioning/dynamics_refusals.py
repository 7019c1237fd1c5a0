"""No force loop on an axis that was not identified, or was on another computer, at another rate, by another drive."""

from controller.loop.steps import Program, TrackForce
from drivers.roles import Identity
from rig.computer import computer_id
from rig.config.axis_dynamics import AxisDynamics
from rig.config.calibration import AnyCalibration, what_of, what_to_calibrate
from rig.config.products.roles import MOCK_PORT
from rig.config.wiring import Wiring
from rig.errors import UsageError


def dynamics_reasons(program: Program, wiring: Wiring, axis: Identity) -> list[str]:
    """Why ``program`` may not close its force loop, one sentence each; empty where it has none, or may.

    Age and width of intervals are told by `Calibration.unfit`.
    """
    if not any(isinstance(step, TrackForce) for step in program.steps):
        return []
    known = wiring.calibration.of_dynamics
    if known is None:
        return [_missing(f"{axis.product} {axis.serial}")]
    return [*foreign(known, axis), *dynamics_elsewhere(known, wiring)]


def refuse_unidentified(wiring: Wiring) -> None:
    """The same as far as it is known before the axis homes; raises UsageError. A mock axis is identified by itself."""
    known = wiring.calibration.of_dynamics
    if known is None and wiring.axis.port == MOCK_PORT:
        return
    reasons = dynamics_elsewhere(known, wiring) if known else [_missing(f"the axis at {wiring.axis.port}")]
    if reasons:
        raise UsageError("; ".join(reasons))


def dynamics_elsewhere(known: AxisDynamics, wiring: Wiring) -> list[str]:
    """Why they do not hold for a loop of ``wiring`` on this computer."""
    return known.elsewhere(computer_id(), wiring.loop.rate_Hz, wiring.force.product)


def foreign(known: AnyCalibration, answered: Identity) -> list[str]:
    """Why a calibration of any kind does not hold for the device that ``answered``; empty if it does."""
    if (known.product, known.serial) == (answered.product, answered.serial):
        return []
    return [
        f"calibration.{what_of(known)} is of {known.product} {known.serial}, but {answered.product} {answered.serial}"
        f" answered: give its own, or run `rig calibrate {what_to_calibrate(known)}`"
    ]


def _missing(whose: str) -> str:
    return f"no dynamics of {whose}: run `rig calibrate axis --dynamics` and give its file as calibration.dynamics"
