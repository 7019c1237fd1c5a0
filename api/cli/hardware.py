"""Commands about devices: mock and doctor."""

import contextlib
import sys
from typing import Annotated

import typer

from api.cli.computing import compute
from api.cli.mock_bench import bench_for, bench_process
from api.cli.options import ConfigOption, JsonOption, SetOption, wiring_from
from api.cli.output import show, write_json
from api.operations import doctor as work
from controller.claims import holder
from mock_devices.parameters import load_parameters
from rig.config.endpoints import Endpoints
from rig.config.products.registry import ROLES
from rig.config.products.roles import AxisProduct
from rig.errors import CheckFailed
from rig.results.bench import DeviceReport
from rig.results.tables import TextTable


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
    wiring = wiring_from(config, overrides)
    scale = load_parameters(wiring.mock.parameters).axis.increments_per_mm
    with bench_process(wiring, tuple(hide or ()), seed, every_product=True) as (process, endpoints):
        sys.stdout.write(endpoints.model_dump_json() + "\n" if as_json else _lines(endpoints, scale))
        sys.stdout.flush()
        with contextlib.suppress(KeyboardInterrupt):
            process.wait()


def _lines(endpoints: Endpoints, scale: float) -> str:
    """Endpoints for a person, as the lines of a wiring file; ``scale`` [1/mm] is the carriage's, and has its sign."""
    lines = ["# the mock bench is ready; Ctrl-C ends it"]
    for role, products in ROLES.items():
        for name, product in products.items():
            if product.mock is None:
                continue
            lines.append(f'{role}.port = "{product.mock.address(endpoints)}"            # {name}')
            if issubclass(product, AxisProduct):
                per_mm = abs(scale) if product().scale_unstated else product().increments_per_mm
                lines.append(f"{role}.increments_per_mm = {per_mm:g}            # {name}")
                if scale < 0:
                    lines.append(f"{role}.direction = -1            # {name}")
            if product.mock.role in endpoints.latency_ms:
                lines.append(f"{role}.latency_ms = {endpoints.latency_ms[product.mock.role]:g}            # {name}")
    return "\n".join([*lines, f"# control channel: {endpoints.control}", ""])


def _row(finding: DeviceReport) -> tuple[str, ...]:
    if not finding.product:
        return finding.role, f"not heard; look at {finding.advice}" if finding.advice else "not heard"
    more = "".join(f"; {words}" for words in (finding.settings.get("scale"), finding.bus) if words)
    device = f"{finding.product}, serial {finding.serial}, firmware {finding.firmware}{more}"
    latency = f"{finding.latency_ms:.2f}" if finding.latency_ms else ""
    return finding.role, device, f"{finding.rate_Hz:.1f}", finding.noise, latency, finding.range


def doctor(config: ConfigOption = None, overrides: SetOption = None, json_file: JsonOption = None) -> None:
    """Looks at each device without moving anything: identity, measured rate, noise, latency, range.

    A service that uses the bench is asked what it knows, and is not disturbed.

    Example: rig doctor --config rig.toml
    """
    wiring = wiring_from(config, overrides)
    held = holder(wiring)
    if held:
        result = compute("doctor", lambda operation: work.ask_service(operation, held))
    else:
        with bench_for(wiring, approaches=False) as (live_wiring, _):
            result = compute("doctor", lambda operation: work.doctor(operation, live_wiring))
    header = ("role", "device", "rate (Hz)", "noise", "latency (ms)", "range seen")
    show(TextTable("Devices", header, [_row(found) for found in result.devices], words=2))
    write_json(json_file, result)
    broken = [f"{found.role}: {found.problem}" for found in result.devices if found.problem]
    if broken:
        raise CheckFailed("; ".join(broken))
