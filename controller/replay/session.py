"""All recordings of a session replayed, each row compared bit by bit with the one that was recorded."""

import json
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from controller.devices.health import ON_RATE
from controller.loop.carried import Carried
from controller.loop.steps import Program
from controller.replay.given import Given, given_by
from controller.replay.loop import ReplayedLoop
from controller.safety.table import TABLE, Action, Check
from rig.channels import EventSample, LoopSample
from rig.config.table import merged, parse
from rig.config.wiring import Wiring
from rig.errors import DataError
from rig.recording.reader import Recording, read_recording
from rig.recording.sessions import Session, open_session
from rig.results.replay import ReplayDifference, ReplayedRecording, ReplayResult

# Of a recording without end the first few say all; the rest is counted.
MOST_DIFFERENCES = 20
# A mean rate remembers fifty samples from before the recording: after 400 they weigh 0.98^400, three in ten thousand.
SETTLED_SAMPLES = 400
# What the loop says of itself; the rest of the events are other processes', or about devices that come back.
DECIDED = frozenset({"contact", "program_end"})
PERIOD = "period_ns"
ON_RATE_BITS = ON_RATE | ON_RATE << 3 | ON_RATE << 6
Read = TypeVar("Read")


def replay(folder: Path, overrides: Iterable[str] = (), table: tuple[Check, ...] = TABLE) -> ReplayResult:
    """Every recording of the session in ``folder``, under its own wiring with ``overrides``."""
    return replay_session(open_session(folder), overrides, table=table)


def replay_session(
    session: Session, overrides: Iterable[str] = (), only: Callable[[str], bool] = lambda _: True,
    table: tuple[Check, ...] = TABLE, tell: Callable[[str], None] = lambda _: None,
) -> ReplayResult:  # fmt: skip
    """Recordings whose name is ``only``; ``tell`` is told each of them."""
    found, overrides = [], tuple(overrides)
    for trial in session.trials:
        if only(trial.name):
            tell(trial.name)
            found.append(replay_recording(read_recording(session.folder / trial.file), overrides, table))
    return ReplayResult(recordings=tuple(found))


def replay_recording(
    recording: Recording, overrides: Iterable[str] = (), table: tuple[Check, ...] = TABLE
) -> ReplayedRecording:
    """One recording; raises DataError where it holds no program, or another version's configuration."""
    rows = [LoopSample(*row) for row in recording.tables["loop"].tolist()]
    program, start_ns = _program(recording)
    if not rows:
        raise DataError(f"{recording.path}: holds no rows of the loop: nothing can be replayed")
    wiring, periods_ns = _wiring(recording, overrides), _periods_ns(recording)
    loop = ReplayedLoop(wiring, recording, periods_ns, program, start_ns, _carried(recording), table)
    loop.seed(rows[0])
    given = given_by(recording.events)
    made = [loop.cycle(row, given.get(row.capture_ns, Given())) for row in rows]
    first = next((at + 1 for at, row in enumerate(rows) if row.capture_ns >= start_ns), len(rows))
    differing = list(_differing(rows, made, first))
    events = list(_events_apart(recording.events, loop.ring.events, rows))
    return ReplayedRecording(
        recording=recording.path.name,
        rows=len(rows),
        compared=len(rows) - first,
        given=tuple(name for one in given.values() for name in one.named),
        stops=tuple(f"{event.code}: {event.text}" for event in loop.ring.events if event.level >= Action.SOFT),
        differing_rows=len({one.row for one in differing}),
        differences=tuple(sorted((*events, *differing), key=lambda one: one.row)[:MOST_DIFFERENCES]),
    )


def _read(recording: Recording, what: str, read: Callable[[], Read]) -> Read:
    try:
        return read()
    except KeyError as error:
        raise DataError(
            f"{recording.path}: holds no {what} ({error} is missing): only what this version of tissue-rig recorded on"
            " a bench can be replayed"
        ) from error
    except (ValidationError, json.JSONDecodeError) as error:
        raise DataError(f"{recording.path}: its {what} is none of this version: {error}") from error


def _program(recording: Recording) -> tuple[Program, int]:
    """The program, and the cycle after which it began."""
    program = _read(recording, "program", lambda: Program.model_validate_json(recording.metadata["program"]["steps"]))
    starts = [event.capture_ns for event in recording.events if event.code == "program_start"]
    if not starts:
        raise DataError(f"{recording.path}: its program never began: there is nothing to replay")
    return program, starts[0]


def _wiring(recording: Recording, overrides: Iterable[str]) -> Wiring:
    tables = _read(recording, "wiring", lambda: recording.metadata["wiring"])
    values = {name: json.loads(text) for name, text in tables.items() if name in Wiring.model_fields}
    return parse(Wiring, merged(values, overrides), str(recording.path))


def _periods_ns(recording: Recording) -> dict[str, int]:
    """Of each device, as its driver gave it: the configured rate is one that it may only come near."""
    devices = _read(recording, "devices", lambda: recording.metadata["devices"])
    found = {role: json.loads(text)["settings"] for role, text in devices.items() if text.startswith("{")}
    return _read(recording, "period of a device", lambda: {role: int(said[PERIOD]) for role, said in found.items()})


def _carried(recording: Recording) -> Carried:
    """What a recording without an end says nothing of begins as a loop does."""
    text = recording.metadata.get("summary", {}).get("carried")
    return _read(recording, "summary", lambda: TypeAdapter(Carried).validate_json(text)) if text else Carried()


def _differing(rows: list[LoopSample], made: list[LoopSample], first: int) -> Iterator[ReplayDifference]:
    for at in range(first, len(rows)):
        for name, was, now in zip(LoopSample._fields, rows[at], made[at], strict=True):
            if name == "seq" or _same(was, now):
                continue
            if name == "health" and at < SETTLED_SAMPLES and int(was) | ON_RATE_BITS == int(now) | ON_RATE_BITS:
                continue
            yield _difference(rows, at, name, repr(was), repr(now))


def _same(was: float, now: float) -> bool:
    """Bit by bit, as far as a number can tell; nothing known is nothing known."""
    return was == now or (math.isnan(was) and math.isnan(now))


def _difference(rows: list[LoopSample], at: int, name: str, was: str, now: str) -> ReplayDifference:
    time_s = (rows[at].capture_ns - rows[0].capture_ns) * 1e-9
    return ReplayDifference(row=at, time_s=time_s, field=name, recorded=was, replayed=now)


def _events_apart(
    recorded: Iterable[EventSample], made: Iterable[EventSample], rows: list[LoopSample]
) -> Iterator[ReplayDifference]:
    """Stops, contacts and ends that one of them has at a cycle and the other has not."""
    places = {row.capture_ns: at for at, row in enumerate(rows)}
    was, now = _decided(recorded, places), _decided(made, places)
    for time_ns in sorted(was.keys() | now.keys()):
        before, after = was.get(time_ns, ""), now.get(time_ns, "")
        if before != after:
            yield _difference(rows, places[time_ns], "event", before or "nothing", after or "nothing")


def _decided(events: Iterable[EventSample], places: dict[int, int]) -> dict[int, str]:
    found: dict[int, str] = {}
    for event in events:
        if (event.level >= Action.SOFT or event.code in DECIDED) and event.capture_ns in places:
            said = f"{event.code}: {event.text}"
            found[event.capture_ns] = f"{found[event.capture_ns]}; {said}" if event.capture_ns in found else said
    return found
