"""`rig`: the commands, and the one place where a failure becomes a sentence and an exit code.

Only the module of the command asked for is imported: numerics, plotting and HTTP together take a second to load.
"""

import os
import sys
from collections.abc import Callable
from importlib import import_module

import typer
from rich.console import Console

from rig.errors import RigError

COMMANDS = {
    "capture": "api.cli.motion:capture",
    "track": "api.cli.motion:track",
    "simulate": "api.cli.simulate:simulate",
    "threshold": "api.cli.threshold:threshold",
    "fit": "api.cli.science:fit",
    "report": "api.cli.science:report",
    "diagnose": "api.cli.diagnose:diagnose",
    "protocol": "api.cli.diagnose:protocol",
    "verify": "api.cli.records:verify",
    "repair": "api.cli.records:repair",
    "import": "api.cli.records:import_",
    "export": "api.cli.records:export_",
    "serve": "api.cli.serve:serve",
    "mock": "api.cli.hardware:mock",
    "doctor": "api.cli.hardware:doctor",
    "demo": "api.cli.demo:demo",
}


def build(wanted: str | None = None) -> typer.Typer:
    """The application with the command ``wanted``, or with all where it is none of them."""
    app = typer.Typer(
        help="Software for a soft-tissue bench: capture, fit, track, report. Exit codes: 0 ok, 1 check failed,"
        " 2 wrong use, 3 safety stop.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        add_completion=False,
    )
    # A callback keeps the name of the command on the line also where only one is loaded.
    app.callback()(lambda: None)
    names = [wanted] if wanted in COMMANDS else list(COMMANDS)
    for name in names:
        app.command(name)(_load(COMMANDS[name]))
    return app


def _load(target: str) -> Callable[..., None]:
    module, _, function = target.partition(":")
    command: Callable[..., None] = vars(import_module(module))[function]
    return command


def main() -> None:
    """Entry point of the `rig` command."""
    # Its matrices are small: threads of linear algebra mostly wait for one another, and take a core from the loop.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        build(next(iter(sys.argv[1:]), None))()
    except RigError as error:
        Console(stderr=True, highlight=False, soft_wrap=True).print(f"rig: {error}", markup=False)
        sys.exit(error.exit_code)
