"""How the axis follows its set-point: swept in the air by this computer, at the loop's rate; nobody else has it."""

from contextlib import AbstractContextManager
from datetime import UTC, datetime

from api.operations.calibrate import AT_ONCE, AxisStart, resting_axis
from controller.commissioning.axis import as_answered
from controller.commissioning.axis_dynamics import identify
from controller.commissioning.sweep import AirSweep, sweep_for
from controller.commissioning.sweep_moves import CLEAR_MM, SweepRun, refuse_outside, refuse_touching
from controller.operation import Operation
from rig.computer import computer_id
from rig.config.axis_dynamics import AxisDynamics
from rig.config.wiring import Wiring

# Sixteen repeats have a quarter of one's noise; at 0.5 s a sweep goes through three times the band of an axis of 34 Hz
# with a resolution of 14 Hz.
SWEEP_S, REPEATS, TURNS = 0.5, 16, 6


def sweep_asked(wiring: Wiring, from_mm: float) -> AirSweep:
    """The sweep that limits and product allow; raises UsageError, before anything is opened, where none fits."""
    sweep = sweep_for(wiring, SWEEP_S, REPEATS, TURNS)
    refuse_outside(from_mm, sweep, wiring)
    return sweep


def sweep_way(sweep: AirSweep, from_mm: float) -> str:
    """What has to be free for it."""
    return f"home to {from_mm + sweep.way_mm + CLEAR_MM:.1f} mm"


def axis_dynamics(operation: Operation, wiring: Wiring, from_mm: float, start: AxisStart = AT_ONCE) -> AxisDynamics:
    """The dynamics, swept from ``from_mm`` on; raises CheckFailed with number and bound, SafetyStop for a touch."""
    sweep = sweep_asked(wiring, from_mm)
    with resting_axis(operation, wiring, start) as resting:
        drive = resting.devices.axis.identity
        sweep = sweep_asked(wiring.model_copy(update={"axis": as_answered(wiring.axis, drive)}), from_mm)
        operation.advance(0.0, "looking for anything in the way")
        refuse_touching(resting.axis, from_mm, sweep)
        operation.advance(0.3, f"{sweep.repeats} sweeps of {sweep.lowest_Hz:g} to {sweep.highest_Hz:g} Hz")
        moving: AbstractContextManager[None] = resting.moving()
        with moving:
            resting.devices.axis.enable()
            followed = SweepRun(resting.devices, wiring, sweep, resting.interrupted).played()
    return identify(drive, wiring, sweep, followed, datetime.now(UTC), computer_id())
