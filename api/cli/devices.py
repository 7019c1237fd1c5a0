"""Commands about what could stand on the bench: devices and find."""

from typing import Annotated

import typer

from api.cli.asking import Person
from api.cli.computing import compute
from api.cli.options import JsonOption
from api.cli.output import show, write_json
from api.operations import devices as work
from controller.devices import finding
from controller.operation import Operation
from rig.config.products.inputs import EVERY_ROLE
from rig.errors import CheckFailed, UsageError
from rig.results.devices import DevicesResult, FindResult, PortFound, ProductListed
from rig.results.tables import TextTable


def devices(
    product: Annotated[str, typer.Argument(help="One product, with all keys of its table.")] = "",
    json_file: JsonOption = None,
) -> None:
    """Lists the products this installation knows, whose they are, their options, and plug-ins that failed.

    Example: rig devices maxon-epos4
    """
    result = work.devices(product)
    show(_products(result))
    if product:
        show(*map(_options, result.products))
    if result.plugins:
        rows = [(one.group, one.name, f"{one.distribution} {one.distribution_version}", one.error or "in use")
                for one in result.plugins]  # fmt: skip
        show(TextTable("Plug-ins", ("group", "name", "of", "state"), rows, words=4))
    write_json(json_file, result)


def _products(result: DevicesResult) -> TextTable:
    rows = [
        (one.role, one.product, f"{one.distribution} {one.distribution_version}",
         f"{one.rate_Hz:g}" if one.rate_Hz else "as asked", "yes" if one.simulated else "no", one.meaning)
        for one in result.products
    ]  # fmt: skip
    return TextTable(result.software, ("role", "product", "of", "rate (Hz)", "simulated", "what it is"), rows, words=6)


def _options(product: ProductListed) -> TextTable:
    table = f"{product.role}.NAME" if product.role == "input" else product.role
    rows = [(f"{table}.{one.key}", one.value, one.default, one.meaning) for one in product.options]
    return TextTable(f"Keys of {product.product}", ("key", "value", "default", "meaning"), rows, words=4)


def _in_help() -> str:
    """The products with their own keys, for whoever asks for help."""
    lines = []
    for role, products in EVERY_ROLE.items():
        shared = set.intersection(*(set(product.model_fields) for product in products.values()))
        for name, product in products.items():
            own = ", ".join(key for key in product.model_fields if key not in shared)
            lines.append(f'[{role}] product = "{name}": {own or "those of the role"}')
    return "\n\n".join(["Products and the keys that only they have:", *lines])


devices.__doc__ = f"{devices.__doc__}\n\n{_in_help()}"


def find(
    addresses: Annotated[
        list[str] | None, typer.Argument(help="Ports beside those of USB: a device path, or tcp://host:port.")
    ] = None,
    ask: Annotated[bool, typer.Option("--ask", help="Asks you before it writes to a port.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Writes to every port that it lists, without asking you.")] = False,
    json_file: JsonOption = None,
) -> None:
    """Lists ports, CAN buses, switches and streams; with your consent asks at each port who is there.

    Says the lines for rig.toml.

    Without --ask or --yes nothing is written to any port: it may be somebody else's device.

    Example: rig find --ask
    """
    if ask and yes:
        raise UsageError("--ask and --yes: give one of them")
    alone = [*finding.buses(), *finding.switches(), *finding.streams()]
    seen = [*finding.ports(), *alone, *map(finding.named, addresses or [])]
    result = compute("find", lambda operation: _found(operation, seen, ask, yes))
    rows = [_row(port) for port in result.ports] or [("none", "", "", "plug it in, or name its port: tcp://host:port")]
    show(TextTable("Ports", ("port", "USB", "adapter", "who answers"), rows, words=4))
    show(*(port.lines for port in result.ports if port.lines))
    write_json(json_file, result)
    silent = [port for port in result.ports if port.problem]
    if silent:
        raise CheckFailed("; ".join(f"{port.address}: {port.problem}" for port in silent))


def _found(operation: Operation, seen: list[PortFound], ask: bool, yes: bool) -> FindResult:
    person = Person()

    def consent(port: PortFound) -> bool:
        about = ", ".join(part for part in (port.usb, port.kind) if part)
        question = f"write to {port.address} ({about}) to see who is there? [y/N]"
        allowed = yes or (ask and person.answer(question, "--yes").strip().lower() in ("y", "yes"))
        if allowed:
            operation.say(f"asking at {port.address}")
        return allowed

    return FindResult(ports=tuple(finding.find(seen, consent)))


def _row(port: PortFound) -> tuple[str, ...]:
    answers = f"{port.device}, serial {port.serial}" if port.serial else ("nobody" if port.asked else "not asked")
    return port.address, port.usb or "none", port.kind or "unknown", answers
