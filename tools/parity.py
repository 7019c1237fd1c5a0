"""The table of parity: for each command its route and its view of the page, or the reasons why there is none.

Commands come from the command line itself, kinds of jobs from the service, views from `api/page/sources/parity.json`.
"""

import inspect
import json
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from typer.models import ArgumentInfo

from api.cli.app import COMMANDS
from api.http.jobs.kinds import KINDS

ROOT = Path(__file__).parents[1]
VIEWS = ROOT / "api" / "page" / "sources" / "parity.json"
HEADER = "| command | REST, below `/api/v1` | page |\n|---|---|---|"
# What is no job: the routes of a command.
ROUTES: Mapping[str, tuple[str, ...]] = {
    **{f"catalogue {what}": (f"GET /{what}",) for what in (
        "sessions", "trials", "models", "diagnoses", "causes", "operations", "sites",
    )},
    "catalogue rebuild": ("POST /catalogue/rebuild",),
    "devices": ("GET /devices",),
    "export": ("GET /sessions/{session}/export/{form}",),
    "import": ("POST /uploads",),
    "reset": ("POST /recover", "POST /estop/reset"),
    "subject list": ("GET /subjects",),
    "subject show": ("GET /subjects/{subject}",),
    "subject name": ("PUT /subjects/{subject}/name",),
    "subject export": ("GET /subjects/{subject}/export",),
    "subject erase": ("DELETE /subjects/{subject}",),
    "token create": ("POST /tokens",),
    "token list": ("GET /tokens",),
    "token revoke": ("DELETE /tokens/{name}",),
    "token link": ("POST /auth/links",),
    "account list": ("GET /accounts",),
}  # fmt: skip
BY_THE_ACCOUNT = "only the account that owns the files: whoever may do this over HTTP could make any other right"
# What has no route, and why.
WITHOUT: Mapping[str, str] = {
    "track --table": "compares gains on simulated subjects of its own, never on the bench that is served",
    "replay": "tests the program that is installed against a recording, and writes a test beside its sources",
    "find": "writes to ports of the computer that may be anybody's: a person beside them allows each",
    "catalogue backup": "names of people leave the computer by its own account alone",
    "catalogue restore": "names of people come back by the computer's own account alone",
    "account set": BY_THE_ACCOUNT,
    "account remove": BY_THE_ACCOUNT,
    "serve": "is the service itself",
    "mock": "a simulated bench is started beside a service, not by it",
    "demo": "runs a bench of its own; with --serve it ends in a service",
}
# What has a route and no view, and why; what has no route needs no second reason.
UNSEEN: Mapping[str, str] = {
    "catalogue causes": "asked across all subjects by programs; a diagnosis is read with its session",
    "catalogue operations": "each session shows what was made of it",
    "catalogue rebuild": "asked for by a message that names it, of a catalogue that nobody can read",
    "catalogue sites": "each subject shows its own",
    "devices": "what could be installed; the page shows what stands on the bench",
    "repair": "makes another recording beside the one that is not whole, which a person compares first",
    "simulate": "the runs' own forecast stands beside each start; a simulation is of a bench that is not there",
}
# Options that make another command of one.
ALSO = ("track --table", "calibrate axis --dynamics")


class Row(NamedTuple):
    """A command with what does the same elsewhere."""

    command: str
    routes: tuple[str, ...]
    reason: str
    view: str
    unseen: str


def commands() -> Iterator[str]:
    """Every command; one that is followed by a verb once for each verb."""
    for name, target in COMMANDS.items():
        verbs = _verbs(target)
        yield from (f"{name} {verb}" for verb in verbs) if verbs else (name,)
    yield from ALSO


def _verbs(target: str) -> tuple[str, ...]:
    """Of a command whose first argument is one of a few words."""
    module, _, function = target.partition(":")
    command = vars(import_module(module))[function]
    hints = get_type_hints(command, include_extras=True)
    first = next((hints[name] for name in inspect.signature(command).parameters if _is_argument(hints[name])), None)
    words = get_args(first)[0] if first else None
    return get_args(words) if get_origin(words) is Literal else ()


def _is_argument(hint: Any) -> bool:
    return any(isinstance(part, ArgumentInfo) for part in get_args(hint)[1:])


def rows() -> list[Row]:
    """The table."""
    views = json.loads(VIEWS.read_text())
    return [
        Row(name, _routes(name), WITHOUT.get(name, ""), views.get(name, ""), UNSEEN.get(name, ""))
        for name in commands()
    ]


def _routes(command: str) -> tuple[str, ...]:
    own = (command, command.split(maxsplit=1)[0])
    jobs = tuple(f"POST /jobs, kind {kind.name}" for kind in KINDS.values() if kind.command in own)
    return () if command in WITHOUT else (*ROUTES.get(command, ()), *jobs)


def parity() -> str:
    """Markdown of the table."""
    return "\n".join([HEADER, *map(_line, sorted(rows()))])


def _line(row: Row) -> str:
    rest = ", ".join(f"`{route}`" for route in row.routes) or f"none: {row.reason}"
    page = row.view or (f"none: {row.unseen}" if row.unseen else "none")
    return f"| `rig {row.command}` | {rest} | {page} |"
