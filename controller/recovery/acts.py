"""Recovery inside the loop, at rest only: how things stand, and the acts that a person has agreed to."""

import math
from typing import TYPE_CHECKING

from controller.recovery.situation import Situation, is_retracted
from controller.safety.table import Action
from rig.errors import UsageError
from rig.results.bench import Act

if TYPE_CHECKING:
    from controller.loop.bench_loop import BenchLoop


def survey(loop: "BenchLoop") -> Situation:
    """How things stand; raises UsageError while anything moves."""
    _refuse_moving(loop)
    state, axis, lost = loop.state, loop.devices.axis, loop.inputs.axis_lost
    referenced = not lost and axis.referenced and math.isfinite(state.position_mm)
    force_N = state.load.force_N
    return Situation(
        stopped=loop.machine.latched.text if loop.machine.latched else "",
        lost=lost,
        fault="" if lost else axis.fault,
        history=() if lost else axis.history(),
        referenced=referenced,
        retracted=referenced and is_retracted(state.position_mm, loop.wiring.limits),
        outward=loop.wiring.axis.homes_outward,
        position_mm=state.position_mm if referenced else None,
        force_N=None if loop.inputs.force_lost or not math.isfinite(force_N) else force_N,
    )


def do(loop: "BenchLoop", act: Act) -> None:
    """One act; raises UsageError where it may not be done now, DeviceError where it does not succeed."""
    _refuse_moving(loop)
    if loop.inputs.axis_lost:
        raise UsageError(f"the axis does not answer: {loop.inputs.axis_lost}; check its power and cable")
    loop.event(Action.NOTE, "recovery", act, loop.state.now_ns)
    {"clear": _clear, "retract": _retract, "home": _home}[act](loop)


def _refuse_moving(loop: "BenchLoop") -> None:
    if loop.machine.busy:
        raise UsageError("something moves: wait until it stands, then recover")


def _clear(loop: "BenchLoop") -> None:
    loop.devices.axis.reset_fault()


def _retract(loop: "BenchLoop") -> None:
    if not loop.devices.axis.referenced:
        raise UsageError("the axis has no reference: only homing can move it")
    _regain(loop)
    loop.machine.withdraw()


def _home(loop: "BenchLoop") -> None:
    """Waits for the drive's own homing; the loop stands still for as long, at rest and without torque of its own."""
    axis, limits = loop.devices.axis, loop.wiring.limits
    if axis.referenced and not is_retracted(loop.state.position_mm, limits):
        raise UsageError(f"the tip stands at {loop.state.position_mm:.1f} mm: retract it before the axis is homed")
    axis.home()
    _regain(loop)
    loop.state.position_mm = math.nan  # the next report says where that is now
    for stream in loop.health:  # the loop stood still meanwhile, which is no fault of theirs
        loop.forget(stream)


def _regain(loop: "BenchLoop") -> None:
    """Torque on at the present position."""
    loop.devices.axis.enable()
    loop.braked = False
