"""Recordings of a bench that is not there: everything its loop put into the ring, with the metadata of a real one."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from controller.loop.messages import Finished
from controller.loop.steps import Program, Step
from rig.channels import BY_NAME, EVENT, STREAMS
from rig.recording.reader import Recording
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


def fields() -> tuple[str, ...]:
    """Of a row of the loop."""
    return tuple(BY_NAME["loop"].kinds)
