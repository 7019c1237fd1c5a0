"""`rig reset`: the way back after a crash, a fault or a stop, one consent for each thing that acts on the bench."""

import sys
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, replace
from typing import Annotated

import typer

from api.cli.options import ConfigOption, JsonOption, SetOption, wiring_from
from api.cli.output import console, write_json
from api.cli.remote import RemoteBench
from api.cli.stage import bench_for
from controller.claims import holder
from controller.recovery.situation import ALL, Act, Consent, Recovered
from controller.supervisor import Supervisor
from rig.errors import CheckFailed, UsageError

Recover = Callable[[Consent], Recovered]
Ask = Callable[[Act, str], bool]


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
    held = holder(wiring)
    if held and held.address:
        with RemoteBench(held.address) as remote:
            found = converse(remote.recover, agreed, ask)
    else:
        with (
            bench_for(wiring, approaches=False) as (live_wiring, _),
            closing(Supervisor(live_wiring, waiting=True)) as bench,
        ):
            bench.start()
            found = converse(bench.recover, agreed, ask)
    write_json(json_file, asdict(found) | {"ready": found.ready})
    if found.missing:
        raise CheckFailed(f"the axis is recovered, but {found.missing}")


def converse(recover: Recover, agreed: Consent, ask: Ask) -> Recovered:
    """Recovers as far as is agreed to, and asks for what is not; raises CheckFailed after a no."""
    found = recover(agreed)
    say(found.happened)
    while found.open:
        say(found.done)
        for act, question in found.open:
            if not ask(act, question):
                raise CheckFailed(f"not agreed to: {question} Nothing more was done")
            agreed = replace(agreed, **{act: True})
        found = recover(agreed)
    say([*found.done, found.missing or "the bench is ready"])
    return found


def say(sentences: list[str] | tuple[str, ...]) -> None:
    """One line each."""
    for sentence in sentences:
        console.print(sentence, highlight=False, markup=False)


def ask(act: Act, question: str) -> bool:
    """At the terminal; without one the question stays open, and UsageError names the option that answers it."""
    if not sys.stdin.isatty():
        raise UsageError(f"{question} Agree with --{act}, or to everything with --yes")
    return typer.confirm(question)
