"""Recordings of a bench that is not there: everything its loop put into the ring, with the metadata of a real one."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from controller.loop.messages import Finished
from controller.loop.steps import Program, Step
from rig.channels import BY_NAME, EVENT, STREAMS
from rig.recording.mcap_file import RecordingWriter
from rig.recording.reader import Recording
from rig.recording.sessions import SessionInfo, TrialInfo, write_session
from tests.controller.fake_bench import FakeBench

LEAD_S = 0.15


def begin(bench: FakeBench, *steps: Step) -> Program:
    """What a recording begins with: a while of rest, then the program."""
    for rows in bench.ring.rows.values():
        rows.clear()
    bench.wait(LEAD_S)
    bench.begin(*steps)
    return Program(name="test", steps=steps)


def recorded(bench: FakeBench, program: Program) -> Recording:
    """What a recorder would have kept."""
    tables = {
        stream.name: np.array([tuple(row) for row in bench.ring.rows[stream.id]], stream.dtype)
        for stream in STREAMS
        if not stream.has_text
    }
    finished = [message for message in bench.link.sent if isinstance(message, Finished)]
    summary = {"carried": json.dumps(asdict(finished[-1].outcome.carried))} if finished else {}
    metadata = {
        "wiring": {name: json.dumps(table) for name, table in bench.wiring.model_dump(mode="json").items()},
        "devices": {
            role: json.dumps({"product": "fake", "settings": {"period_ns": str(device.period_ns)}})
            for role, device in bench.devices.by_role().items()
        },
        "program": {"steps": program.model_dump_json()},
        "summary": summary,
    }
    events = tuple(bench.ring.rows[EVENT.id])
    return Recording(Path("trial_001.mcap"), metadata, tables, events, True, ())  # type: ignore[arg-type] # event rows


def without(recording: Recording, part: str) -> Recording:
    """The same of a version that did not record ``part``."""
    metadata: Mapping[str, dict[str, str]] = {name: table for name, table in recording.metadata.items() if name != part}
    return Recording(recording.path, dict(metadata), recording.tables, recording.events, True, ())


def session_of(recording: Recording, folder: Path) -> Path:
    """A session with that one recording, as `rig capture` leaves it."""
    folder.mkdir()
    begin = {name: table for name, table in recording.metadata.items() if name != "summary"}
    writer = RecordingWriter(folder / recording.path.name, begin)
    for name, rows in recording.tables.items():
        writer.add_rows(BY_NAME[name], rows)
    for event in recording.events:
        writer.add(EVENT.id, EVENT.pack(event))
    writer.finish(recording.metadata["summary"])
    trial = TrialInfo("trial_001", recording.path.name, math.nan, math.nan, "complete")
    write_session(folder, SessionInfo("made", "capture", "2026-11-24", "tissue-rig", trials=(trial,)))
    return folder
