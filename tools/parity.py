"""The tables of parity: for each command its route and its view of the page, for each route its command, or why not.

Commands come from the command line itself, kinds of jobs and routes from the service, views from
`api/page/sources/parity.json`.
"""

import inspect
import json
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from typer.models import ArgumentInfo

from api.cli.app import COMMANDS
from api.http import app
from api.http.jobs.kinds import KINDS
from api.http.routes.common import PREFIX
from api.http.service import Service
from rig.config.wiring import Wiring

ROOT = Path(__file__).parents[1]
VIEWS = ROOT / "api" / "page" / "sources" / "parity.json"
HEADER = "| command | REST, below `/api/v1` | page |\n|---|---|---|"
BY_ROUTE = "| REST, below `/api/v1` | command |\n|---|---|"
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
OF_A_JOB = (
    "a command is itself what a job is: it says how far it is, asks a person, ends by Ctrl-C and writes its files"
)
OF_A_BROWSER = "of a browser; a command is its account's own"
OF_CONTROL = "a command has the bench to itself, or takes the lease of the service that has it"
OF_FILES = "on the computer itself these are files in a folder"
LOOKED_AT = "for whoever looks on; a command says its own values while it runs"
AT_THE_START = "a command brings the bench up for itself, as its configuration says"
FILES = ("/jobs/{identifier}/files/{path}", "/recordings/{session}/{file}", "/sessions/{session}/export/{form}")
# Routes that are of no command, and why.
ALONE: Mapping[str, str] = {
    **dict.fromkeys(("GET /auth/me", "POST /auth/login", "POST /auth/logout", "POST /auth/ticket"), OF_A_BROWSER),
    **dict.fromkeys(("GET /jobs", "GET /jobs/{identifier}", "GET /jobs/{identifier}/files/{path}"), OF_A_JOB),
    **dict.fromkeys((f"POST /jobs/{{identifier}}/{verb}" for verb in ("cancel", "pause", "resume")), OF_A_JOB),
    **dict.fromkeys((f"{verb} /control/lease" for verb in ("GET", "POST", "PUT", "DELETE")), OF_CONTROL),
    "POST /control/take": OF_CONTROL,
    **dict.fromkeys(("GET /events", "GET /streams", "GET /streams/{stream}/latest"), LOOKED_AT),
    **dict.fromkeys(("GET /rig", "POST /rig/connect", "GET /subject", "PUT /subject"), AT_THE_START),
    **dict.fromkeys(("GET /recordings", "GET /recordings/{session}/{file}", "GET /protocols"), OF_FILES),
    **dict.fromkeys(("GET /sessions/{session}", "DELETE /sessions/{session}", "GET /calibrations"), OF_FILES),
    **dict.fromkeys(("GET /uploads", "GET /uploads/{identifier}", "DELETE /uploads/{identifier}"), OF_FILES),
    "GET /audit": OF_FILES,
    **dict.fromkeys((f"HEAD {path}" for path in FILES), "how large a file is; on the computer itself `ls` says it"),
    "GET /sessions/{session}/curves": "points of a picture, which `rig report` draws",
    "GET /protocols/{name}/foresight": "a forecast beside each start; `rig protocol check` says what a protocol shows",
    "POST /estop": "keys, foot switch and Ctrl-C stop a command, and so does the stop process beside it",
    "POST /pain": "likewise",
    "GET /info": "says who the service is",
    "GET /problems/{code}": "explains a refusal of the service; a command says the next step at once",
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


def operations() -> set[str]:
    """Method and path, below the prefix, of all that the service describes; nothing is connected to say it."""
    paths = app.build(Service(Wiring(), Path("sessions"), Path("examples"))).openapi()["paths"]
    return {f"{method.upper()} {path.removeprefix(PREFIX)}" for path, methods in paths.items() for method in methods}


def by_route() -> Mapping[str, tuple[str, ...]]:
    """The commands of each operation."""
    known = [(route.partition(", kind")[0], row.command) for row in sorted(rows()) for route in row.routes]
    return {
        one: tuple(dict.fromkeys(command for route, command in known if route == one)) for one in sorted(operations())
    }


def parity_of_routes() -> str:
    """Markdown of the table of routes."""
    found = {
        route: ", ".join(f"`rig {command}`" for command in commands) or f"none: {ALONE.get(route, '')}"
        for route, commands in by_route().items()
    }
    return "\n".join([BY_ROUTE, *(f"| `{route}` | {said} |" for route, said in found.items())])
