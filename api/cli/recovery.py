"""`rig reset`: the way back after a crash, a fault or a stop, one consent for each thing that acts on the bench."""

import sys
from contextlib import closing
from typing import Annotated

import typer

from api.cli.computing import here
from api.cli.mock_bench import bench_for
from api.cli.options import ConfigOption, JsonOption, SetOption, wiring_from
from api.cli.output import write_json
from api.operations.remote import RemoteBench
from api.operations.reset import reset as recover
from controller.claims import holder
from controller.operation import Operation
from controller.recovery.situation import ALL, Consent
from controller.supervisor import Supervisor
from rig.errors import CheckFailed, UsageError
from rig.results.bench import Act


def reset(
    clear: Annotated[bool, typer.Option("--clear", help="Agrees to clear the drive's fault.")] = False,
    retract: Annotated[bool, typer.Option("--retract", help="Agrees to move the tip out.")] = False,
    home: Annotated[bool, typer.Option("--home", help="Agrees to home the axis where it has no reference.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Agrees to all three.")] = False,
    config: ConfigOption = None,
    overrides: SetOption = None,
    json_file: JsonOption = None,
) -> None:
    """Brings the bench back after a crash or a fault: says what happened, clears the fault, retracts, homes.

    At a terminal each consent is asked for; without one, a question that is open ends the command with exit code 2. A
    service that uses the bench is asked to do it.

    Example: rig reset --config rig.toml --yes
    """
    wiring = wiring_from(config, overrides)
    agreed = ALL if yes else Consent(clear, retract, home)
    held, operation = holder(wiring), Operation("reset")
    if held and held.address:
        with RemoteBench(held.address) as remote:
            found = here(operation, lambda: recover(operation, remote.recover, agreed, ask))
    else:
        with (
            bench_for(wiring, approaches=False) as (live_wiring, _),
            closing(Supervisor(live_wiring, waiting=True)) as bench,
        ):
            bench.start()
            found = here(operation, lambda: recover(operation, bench.recover, agreed, ask))
    write_json(json_file, found)
    if found.missing:
        raise CheckFailed(f"the axis is recovered, but {found.missing}")


def ask(act: Act, question: str) -> bool:
    """At the terminal; without one the question stays open, and UsageError names the option that answers it."""
    if not sys.stdin.isatty():
        raise UsageError(f"{question} Agree with --{act}, or to everything with --yes")
    return typer.confirm(question)
