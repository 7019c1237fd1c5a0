"""What the loop does for its devices a few times a second: takes down their state, and takes over those that came back.

A sensor that came back is used again at once. An axis that came back stays without torque, and the stop is latched: to
move again takes a person.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from controller.devices.connections import of_axis, of_stream
from controller.devices.drivers import Devices
from controller.devices.health import IDENTICAL_LIMIT, StreamHealth
from controller.devices.states import DeviceState, DeviceStatus, Observation
from controller.loop.messages import DeviceShown
from controller.loop.steps import Program, Retract
from controller.safety.table import Action, Incident
from drivers.roles import Device
from rig.config.wiring import Wiring

if TYPE_CHECKING:
    from controller.loop.bench_loop import BenchLoop

STREAMS = {"force": "force", "axis": "axis", "tracker": "marker"}
"""Role to the name of its stream."""


def unheard(wiring: Wiring, devices: Devices, stream: str) -> StreamHealth:
    """The health of a stream before its first sample."""
    loop = wiring.loop
    if stream == "force":
        identical = loop.missed_periods or IDENTICAL_LIMIT
        return StreamHealth(devices.force.period_ns, round(wiring.stale_force_ms * 1e6), identical)
    if stream == "axis":
        return StreamHealth(devices.axis.period_ns, round(loop.stale_axis_ms * 1e6))
    period_ns = devices.tracker.period_ns if devices.tracker else 1
    return StreamHealth(period_ns, round(loop.stale_marker_ms * 1e6))


def attend(loop: "BenchLoop", now_ns: int) -> None:
    """One look at every device, and one step on the way back of those that are missing."""
    seen = observed(loop, now_ns)
    loop.connections.note(seen, now_ns)
    for role in loop.connections.missing(seen):
        _seek(loop, role, now_ns)


def observed(loop: "BenchLoop", now_ns: int) -> dict[str, Observation]:
    """What is seen of each device now."""
    devices, inputs = loop.devices, loop.inputs
    force, tracker = devices.force, devices.tracker
    seen = {
        "force": of_stream(loop.health["force"], inputs.force_lost, now_ns, force.counters.trouble),
        "axis": of_axis(loop.health["axis"], inputs.axis_lost, devices.axis, now_ns),
    }
    if tracker:
        seen["tracker"] = of_stream(loop.health["marker"], inputs.marker_lost, now_ns, tracker.counters.trouble)
    return seen


def _seek(loop: "BenchLoop", role: str, now_ns: int) -> None:
    old = loop.devices.by_role()[role]
    device = loop.connections.reopen(role, old, loop.published[role] + 1, not loop.machine.busy, now_ns)
    if device:
        _take_over(loop, role, device)
    elif loop.connections.under_way(role):
        # The old driver is being closed: nothing may ask it any more.
        _set_lost(loop, role, loop.connections.statuses[role].detail)


def _take_over(loop: "BenchLoop", role: str, device: Device) -> None:
    loop.devices = replace(loop.devices, **{role: device})  # type: ignore[arg-type]
    _set_lost(loop, role, "")
    loop.forget(STREAMS[role])
    if role == "axis" and not loop.machine.latched:
        loop.machine.hold(Incident(Action.IMMEDIATE, "axis_returned", "the axis was lost and is back, without torque"))


def _set_lost(loop: "BenchLoop", role: str, why: str) -> None:
    setattr(loop.inputs, f"{STREAMS[role]}_lost", why)


def refusal(loop: "BenchLoop", program: Program, now_ns: int) -> str:
    """Why ``program`` cannot start as the devices are now; empty if it can. Leaving the tissue takes the axis alone."""
    loop.connections.note(observed(loop, now_ns), now_ns)
    leaves = all(isinstance(step, Retract) for step in program.steps)
    missing = loop.connections.refusal(["axis"] if leaves else None)
    lost = "" if leaves or not loop.inputs.input_lost else f"{loop.inputs.input_lost}; without it nothing moves"
    return missing or lost


def record_state_change(loop: "BenchLoop", role: str, status: DeviceStatus) -> None:
    """Writes a change of state into the event stream."""
    level = Action.NOTE if status.state in (DeviceState.OK, DeviceState.CONNECTING) else Action.WARNING
    loop.event(level, "device_state", f"{role} {status.state}: {status.detail}".rstrip(": "), loop.state.now_ns)


def as_status(statuses: Iterable[tuple[str, DeviceStatus]]) -> dict[str, DeviceShown]:
    """Role -> state, detail and since [ns], for the loop's status."""
    return {
        role: {"state": str(status.state), "detail": status.detail, "since_ns": status.since_ns}
        for role, status in statuses
    }
