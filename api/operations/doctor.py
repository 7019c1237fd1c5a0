"""What is seen of each device: by looking at it, or by asking the service that uses the bench."""

from collections.abc import Mapping

from api.operations.remote import RemoteBench
from controller import doctor as examination
from controller.claims import Holder
from controller.devices.takeover import STREAMS
from controller.loop.messages import DeviceView
from controller.operation import Operation
from rig.config.wiring import Wiring
from rig.errors import CheckFailed, DeviceError
from rig.results.bench import DeviceReport, DoctorResult


def doctor(operation: Operation, wiring: Wiring) -> DoctorResult:
    """Looks at each device for two seconds without moving anything; nobody else may use the bench."""
    return DoctorResult(devices=examination.examine(wiring, tell=operation.step))


def ask_service(operation: Operation, held: Holder) -> DoctorResult:
    """What the service that uses the bench says of each device; raises DeviceError where it is no service."""
    if not held.address:
        raise DeviceError(held.sentence)
    state = RemoteBench(held.address).state()
    operation.say(f"as the service at {held.address} sees them")
    if not state.devices:
        raise CheckFailed(f"the service at {held.address} is {state.state}: {state.reason}")
    return DoctorResult(devices=reports_of(state.devices, state.rates_Hz))


def reports_of(devices: Mapping[str, DeviceView], rates_Hz: Mapping[str, float]) -> tuple[DeviceReport, ...]:
    """Devices as the loop sees them, by role."""
    return tuple(_seen(role, device, rates_Hz) for role, device in devices.items())


def _seen(role: str, device: DeviceView, rates_Hz: Mapping[str, float]) -> DeviceReport:
    state = device.get("state", "unknown")
    return DeviceReport(
        role=role,
        product=device.get("product", ""),
        serial=device.get("serial", ""),
        firmware=device.get("firmware", ""),
        settings=device.get("settings", {}),
        rate_Hz=rates_Hz.get(STREAMS.get(role, role), 0.0),
        problem="" if state == "ok" else f"{state}: {device.get('detail', '')}",
    )
