"""Commands about devices: mock and doctor."""

import contextlib
import sys
from typing import Annotated, Any

import typer

from api.cli.options import ConfigOption, JsonOption, SetOption, wiring_from
from api.cli.output import console, table, write_json
from api.cli.remote import RemoteBench
from api.cli.stage import bench_for, bench_process
from controller import doctor as examination
from controller.claims import Holder, holder
from controller.devices.takeover import STREAMS
from rig.config.endpoints import Endpoints
from rig.config.products.registry import ROLES
from rig.errors import CheckFailed, DeviceError
from rig.results.recorded import DeviceReport, DoctorResult


def mock(
    config: ConfigOption = None,
    overrides: SetOption = None,
    hide: Annotated[
        list[str] | None, typer.Option("--hide", help="Hidden effect: effect.parameter=value; may be repeated.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One line with every endpoint when ready.")] = False,
    seed: Annotated[int | None, typer.Option(help="Seed of all noise.")] = None,
) -> None:
    """Serves the mock bench until Ctrl-C: every device's real protocol on a pseudo-terminal or TCP port.

    Example: rig mock --json --hide friction.level_N=0.2
    """
    with bench_process(wiring_from(config, overrides), tuple(hide or ()), seed, both_sensors=True) as (
        process,
        endpoints,
    ):
        sys.stdout.write(endpoints.model_dump_json() + "\n" if as_json else _lines(endpoints))
        sys.stdout.flush()
        with contextlib.suppress(KeyboardInterrupt):
            process.wait()


def _lines(endpoints: Endpoints) -> str:
    """Endpoints for a person, as the lines of a wiring file."""
    lines = ["# the mock bench is ready; Ctrl-C ends it"]
    for role, products in ROLES.items():
        for name, product in products.items():
            if product.mock is None:
                continue
            lines.append(f'{role}.port = "{product.mock.address(endpoints)}"            # {name}')
            if product.mock.role in endpoints.latency_ms:
                lines.append(f"{role}.latency_ms = {endpoints.latency_ms[product.mock.role]:g}            # {name}")
    return "\n".join([*lines, f"# control channel: {endpoints.control}", ""])


def _row(finding: DeviceReport) -> tuple[str, ...]:
    if not finding.product:
        return finding.role, f"not heard; look at {finding.advice}" if finding.advice else "not heard"
    device = f"{finding.product}, serial {finding.serial}, firmware {finding.firmware}"
    latency = f"{finding.latency_ms:.2f}" if finding.latency_ms else ""
    return finding.role, device, f"{finding.rate_Hz:.1f}", finding.noise, latency, finding.range


def _as_served(held: Holder) -> tuple[DeviceReport, ...]:
    """What the service that uses the bench says of each device; raises DeviceError where it is no service."""
    if not held.address:
        raise DeviceError(held.sentence)
    state = RemoteBench(held.address).state()
    console.print(f"as the service at {held.address} sees them", highlight=False)
    if not state["devices"]:
        raise CheckFailed(f"the service at {held.address} is {state['state']}: {state['reason']}")
    return tuple(_finding(role, device, state["rates_Hz"]) for role, device in state["devices"].items())


def _finding(role: str, device: dict[str, Any], rates_Hz: dict[str, float]) -> DeviceReport:
    state = device.get("state", "unknown")
    return DeviceReport(
        role=role,
        product=str(device["product"]),
        serial=str(device["serial"]),
        firmware=str(device["firmware"]),
        rate_Hz=rates_Hz.get(STREAMS[role], 0.0),
        problem="" if state == "ok" else f"{state}: {device.get('detail', '')}",
    )


def doctor(config: ConfigOption = None, overrides: SetOption = None, json_file: JsonOption = None) -> None:
    """Looks at each device without moving anything: identity, measured rate, noise, latency, range.

    A service that uses the bench is asked what it knows, and is not disturbed.

    Example: rig doctor --config rig.toml
    """
    wiring = wiring_from(config, overrides)
    held = holder(wiring)
    if held:
        findings = _as_served(held)
    else:
        with bench_for(wiring, approaches=False) as (live_wiring, _):
            findings = examination.examine(live_wiring)
    header = ("role", "device", "rate Hz", "noise", "latency ms", "range seen")
    console.print(table(header, map(_row, findings), title="Devices"))
    write_json(json_file, DoctorResult(devices=findings))
    broken = [f"{finding.role}: {finding.problem}" for finding in findings if finding.problem]
    if broken:
        raise CheckFailed("; ".join(broken))
