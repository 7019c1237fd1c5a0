"""`rig`: the commands, and the one place where a failure becomes a sentence and an exit code.

Only the module of the command asked for is imported: numerics, plotting and HTTP together take a second to load.
"""

import ast
import os
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, NoReturn

import typer

import rig
from api.cli.deferred import deferred
from rig.errors import RigError

COMMANDS = {
    "capture": "api.cli.motion:capture",
    "track": "api.cli.motion:track",
    "simulate": "api.cli.simulate:simulate",
    "threshold": "api.cli.threshold:threshold",
    "fit": "api.cli.fitting:fit",
    "report": "api.cli.report:report",
    "diagnose": "api.cli.diagnose:diagnose",
    "protocol": "api.cli.diagnose:protocol",
    "replay": "api.cli.replay:replay",
    "verify": "api.cli.records:verify",
    "repair": "api.cli.records:repair",
    "import": "api.cli.records:import_",
    "export": "api.cli.records:export_",
    "catalogue": "api.cli.catalogue:catalogue",
    "subject": "api.cli.catalogue:subject",
    "serve": "api.cli.serve:serve",
    "account": "api.cli.account:account",
    "token": "api.cli.token:token",
    "mock": "api.cli.hardware:mock",
    "reset": "api.cli.recovery:reset",
    "doctor": "api.cli.hardware:doctor",
    "devices": "api.cli.devices:devices",
    "find": "api.cli.devices:find",
    "calibrate": "api.cli.calibrate:calibrate",
    "demo": "api.cli.demo:demo",
}


def build(wanted: str | None = None) -> typer.Typer:
    """The application with the command ``wanted``; where it is no command, with the name and summary of each."""
    app = typer.Typer(
        help="Software for a soft-tissue bench: capture, fit, track, report. Exit codes: 0 ok, 1 check failed,"
        " 2 wrong use, 3 safety stop, 4 a bad trial remained, 130 interrupted.",
        no_args_is_help=True,
        invoke_without_command=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        add_completion=False,
    )
    # A callback keeps the name of the command on the line also where only one is loaded.
    app.callback()(_common)
    if wanted in COMMANDS:
        app.command(wanted)(_load(COMMANDS[wanted]))
        return app
    for name, target in COMMANDS.items():
        app.command(name, short_help=_summary(target))(lambda: None)
    return app


def _common(version: Annotated[bool, typer.Option("--version", help="Prints the version.")] = False) -> None:
    if version:
        typer.echo(f"tissue-rig {rig.__version__}")
        raise typer.Exit


def _summary(target: str) -> str:
    """First sentence of the command's docstring, read without loading its module."""
    module, _, function = target.partition(":")
    source = find_spec(module)
    assert source and source.origin
    body = ast.parse(Path(source.origin).read_text()).body
    (definition,) = (part for part in body if isinstance(part, ast.FunctionDef) and part.name == function)
    return (ast.get_docstring(definition) or "").partition("\n")[0]


def help_of(name: str) -> str:
    """What ``--help`` says of a command. To parse that word Typer loads pydantic, which takes longer than the rest."""
    module, _, function = COMMANDS[name].partition(":")
    alone = typer.Typer(rich_markup_mode=None, add_completion=False)
    with deferred():
        alone.command(name)(getattr(import_module(module), function))
        command = typer.main.get_command(alone)
        return command.get_help(typer.Context(command, info_name=f"rig {name}"))


def _load(target: str) -> Callable[..., None]:
    from api.cli.output import with_reason  # noqa: PLC0415 - loads pydantic

    module, _, function = target.partition(":")
    command: Callable[..., None] = vars(import_module(module))[function]
    return with_reason(command)


def main() -> None:
    """Runs the command line of this process."""
    # Its matrices are small: threads of linear algebra mostly wait for one another, and take a core from the loop.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        words = sys.argv[1:]
        wanted = next((word for word in words if word != "--"), None)
        if wanted in COMMANDS and "--help" in words and "--" not in words:
            typer.echo(help_of(wanted))
        else:
            build(wanted)()
    except RigError as error:
        _end(error)
    except Exception as error:
        from rig.plugins import blamed  # noqa: PLC0415 - help needs none

        theirs = blamed(error)
        if theirs is None:
            raise
        _end(theirs)


def _end(error: RigError) -> NoReturn:
    from rich.console import Console  # noqa: PLC0415 - help needs none

    Console(stderr=True, highlight=False, soft_wrap=True, emoji=False).print(f"rig: {error}", markup=False)
    sys.exit(error.exit_code)
