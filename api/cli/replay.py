"""The command replay."""

from pathlib import Path
from typing import Annotated

import typer

from api.cli.computing import compute
from api.cli.options import JsonOption, OnlyOption, SetOption
from api.cli.output import show, write_json
from api.operations import replay as work
from rig.errors import CheckFailed
from rig.results.replay import ReplayedRecording, ReplayResult
from rig.results.tables import TextTable


def replay(
    session: Annotated[Path, typer.Argument(help="Session folder as `rig capture` and `rig track` write it.")],
    only: OnlyOption = "*",
    overrides: SetOption = None,
    as_test: Annotated[
        Path | None, typer.Option("--as-test", metavar="FILE", help="Writes a test, test_....py, data beside it.")
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Plays recordings through the loop again and says at which row it decides anything else than was recorded.

    Samples and times are the recorded ones; what the loop makes of them is compared bit by bit. --set asks what would
    have been decided with other limits.

    Example: rig replay sessions/first --as-test tests/test_first_stop.py
    """
    overrides = overrides or []
    result = compute("replay", lambda operation: work.replay(operation, session, overrides, only))
    header = ("recording", "rows", "compared", "other", "stops and what was given")
    show(TextTable("Replay", header, [_row(one) for one in result.recordings], words=1))
    write_json(json_file, result)
    _refuse_different(result)
    if as_test:
        show(work.write_test(session, result, as_test))


def _row(one: ReplayedRecording) -> tuple[str, ...]:
    said = [*one.stops, *(f"given: {name}" for name in one.given)]
    return one.recording, str(one.rows), str(one.compared), str(one.differing_rows), "; ".join(said)


def _refuse_different(result: ReplayResult) -> None:
    firsts = [f"{one.recording}: {one.differences[0].sentence}" for one in result.recordings if one.differences]
    if firsts:
        raise CheckFailed(f"the loop decides other than was recorded: {'; '.join(firsts)}")
