"""Sphinx extension: a line ``<!-- generated: NAME -->`` of a page is replaced by what the program itself says.

Nothing of the reference is written by hand twice: keys come from the models that read the files, commands from the
command line's own help, routes from the service's description.
"""

import re
from collections.abc import Callable
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata
from typer.testing import CliRunner

import rig
from api.cli.app import COMMANDS, build
from api.http import app as service
from api.http.service import Service
from api.operations.devices import devices as known_devices
from rig.config.maxima import MAXIMA
from rig.config.products.registry import AXES
from rig.config.protocol import Indentation
from rig.config.wiring import Wiring
from rig.diagnosis.effects.axis import AXIS_CAUSES
from rig.diagnosis.effects.registry import CAUSES
from rig.tissue.registry import LAWS
from tools.causes import causes as causes_of
from tools.http_routes import routes
from tools.interface import interface
from tools.keys import tables
from tools.laws import laws as laws_of
from tools.parity import parity, parity_of_routes
from tools.schemas import WRITTEN

MARK = re.compile(r"^<!-- generated: ([a-z-]+) -->$", re.MULTILINE)
HELP_COLUMNS = 100
COMMANDS_OF = {
    "came-in": "import`, file `what-came-in.json",
    "calibrate-glove": "calibrate glove", "threshold-glove": "threshold --glove",
    "compare": "track --table", "diagnosis": "diagnose", "protocol-check": "protocol check",
    "catalogue-names": "catalogue backup|restore",
    **{f"catalogue-{what}": f"catalogue {what}" for what in (
        "causes", "diagnoses", "models", "operations", "rebuild", "sessions", "sites", "trials",
    )},
    **{f"subject-{what}": f"subject {what}" for what in ("erase", "export", "list", "show")},
    "retract": "serve`, job `retract", "failure": "COMMAND` without a result, exit code not `0",
}  # fmt: skip


def wiring() -> str:
    """Every key of `rig.toml`, with what none may exceed."""
    largest = (*MAXIMA, *(maximum for axis in AXES.values() for maximum in axis().maxima))
    return tables(Wiring, {key: f"never above {value:g} {unit}: {reason}" for key, value, unit, reason in largest})


def protocol() -> str:
    """Every key of a protocol."""
    return tables(Indentation, {})


def commands() -> str:
    """The help of every command."""
    return "\n".join(f"## rig {name}\n\n```text\n{_help(name)}\n```\n" for name in sorted(COMMANDS))


def _help(name: str) -> str:
    answer = CliRunner().invoke(build(name), [name, "--help"], prog_name="rig", terminal_width=HELP_COLUMNS)
    return answer.output.strip()


def devices() -> str:
    """A row each product of this repository."""
    rows = [
        f"| {one.role} | `{one.product}` | {one.meaning} | {f'{one.rate_Hz:g}' if one.rate_Hz else 'as asked'} |"
        f" {'yes' if one.simulated else 'no'} |"
        for one in known_devices().products
    ]
    return "\n".join(["| role | product | is | samples a second | simulated |", "|---|---|---|---|---|", *rows])


def schemas() -> str:
    """A row each result: the command, and its schema as a file to take away."""
    return "\n".join(_schema_row(name) for name in WRITTEN)


def _schema_row(name: str) -> str:
    return f"| `rig {COMMANDS_OF.get(name, name)}` | {{download}}`{name} <schemas/{name}.schema.json>` |"


def http() -> str:
    """Every route of the service; nothing is connected or written to say what it has."""
    return routes(service.build(Service(Wiring(), Path("sessions"), Path("examples"))).openapi())


def laws() -> str:
    """Every tissue law with its parameters."""
    return laws_of(LAWS.values())


def causes() -> str:
    """Every cause that a diagnosis can name."""
    return causes_of(list(CAUSES.values()))


def axis_causes() -> str:
    """Every cause that a diagnosis of a drive axis can name."""
    return causes_of(list(AXIS_CAUSES.values()))


def python() -> str:
    """Everything that `import rig` offers."""
    return interface(rig)


GENERATORS: dict[str, Callable[[], str]] = {
    "wiring": wiring, "protocol": protocol, "commands": commands, "schemas": schemas,
    "devices": devices,
    "http": http,
    "parity": parity,
    "parity-of-routes": parity_of_routes,
    "laws": laws,
    "python": python,
    "causes": causes,
    "axis-causes": axis_causes,
}  # fmt: skip


def fill(text: str) -> str:
    """``text`` with every mark replaced; a mark that names no generator is a KeyError."""
    return MARK.sub(lambda mark: GENERATORS[mark[1]](), text)


def _on_source_read(_app: Sphinx, _page: str, source: list[str]) -> None:
    source[0] = fill(source[0])


def setup(app: Sphinx) -> ExtensionMetadata:
    """Fills pages as Sphinx reads them."""
    app.connect("source-read", _on_source_read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
