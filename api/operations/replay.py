"""Replaying a session, and making a test of it."""

import shutil
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from controller.operation import Operation
from controller.replay.session import replay_session
from rig.errors import UsageError
from rig.recording.files import refuse_unwritable, whole_folder, write_text
from rig.recording.sessions import SESSION_FILE, open_session
from rig.results.replay import ReplayResult

TEST = '''"""{name}, replayed: made by `rig replay {name} --as-test {file}`.

The loop must decide what it decided when this was recorded, row by row; the data stand in the folder beside this file.
"""

from pathlib import Path

from controller.replay.session import replay

STOPS = {stops}


def test_the_loop_decides_as_it_did() -> None:
    replayed = replay(Path(__file__).with_suffix(""))
    assert [one.sentence for recording in replayed.recordings for one in recording.differences] == []
    assert {{one.recording: list(one.stops) for one in replayed.recordings}} == STOPS
'''


def replay(operation: Operation, session: Path, overrides: Sequence[str], only: str) -> ReplayResult:
    """All recordings that are called like ``only``; raises UsageError where there is none."""
    result = replay_session(open_session(session), overrides, lambda name: fnmatchcase(name, only), tell=operation.say)
    if not result.recordings:
        raise UsageError(f"{session}: no recording is called like {only!r}; `rig verify {session}` lists them")
    return result


def write_test(session: Path, result: ReplayResult, file: Path) -> str:
    """A test file, and a folder of its name with the recordings; says so. Raises UsageError where one is there."""
    folder = file.with_suffix("")
    if not (file.name.startswith("test_") and file.suffix == ".py" and file.stem.isidentifier()):
        raise UsageError(
            f"--as-test {file}: pytest finds files that are called test_....py, of letters, digits and underscores;"
            " give such a name"
        )
    for place in (file, folder):
        if place.exists():
            raise UsageError(f"--as-test {file}: {place} exists already and is not overwritten; give another name")
    refuse_unwritable(file)
    with whole_folder(folder) as scratch:
        listed = [SESSION_FILE] if (session / SESSION_FILE).is_file() else []  # a crash leaves recordings alone
        for name in (*listed, *(one.recording for one in result.recordings)):
            shutil.copyfile(session / name, scratch / name)
    stops, name = {one.recording: list(one.stops) for one in result.recordings}, session.resolve().name
    write_text(file, TEST.format(name=ascii(name)[1:-1].replace('"', "'"), file=file.name, stops=_literal(stops)))
    return f"{file}: a test of {len(result.recordings)} recordings, which it finds in {folder}"


def _literal(stops: dict[str, list[str]]) -> str:
    """A dictionary as Python, a line each."""
    return "{\n" + "".join(f"    {name!r}: {said!r},\n" for name, said in stops.items()) + "}"
