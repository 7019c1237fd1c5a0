"""One program into one recording: metadata before, summary after, and the recording kept whatever happens."""

import json
import threading
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import rig
from controller.commissioning.refusals import refuse_uncommissioned
from controller.loop.messages import Outcome
from controller.loop.steps import Program
from controller.stop.word import StopReason
from controller.supervisor import Supervisor
from drivers.roles import Identity
from rig.config.products.input_role import brought_by
from rig.config.wiring import Wiring
from rig.errors import DeviceError, RigError
from rig.input_streams import METADATA, layouts
from rig.recording.mcap_file import RecordingFailed
from rig.recording.messages import Closed

Metadata = Mapping[str, Mapping[str, str]]
LOOK_S = 0.1
# What a cycle decides looks back 60 ms at most (controller.safety.load), and a tracker is 30 ms late: a recording holds
# all of it before its program begins, so that it can be replayed.
LEAD_S = 0.15
CONTACT_METHOD = "onset of force, extrapolated back through the loading curve"


@dataclass(frozen=True)
class Recorded:
    """What came of it: how the program ended, and how many samples the recording holds and lost, per stream."""

    file: Path
    outcome: Outcome
    samples: dict[str, int]
    dropped: dict[str, int]


def metadata(bench: Supervisor, session: str, trial: str, about: Mapping[str, object]) -> dict[str, dict[str, str]]:
    """The metadata of one recording; nested values are JSON text."""
    return {
        **stated(bench.wiring, session, trial),
        "devices": {role: json.dumps(identity) for role, identity in bench.ready.devices.items()},
        "realtime": dict(bench.ready.realtime),
        "calibration": _calibration(bench.wiring),
        **{name: _texts(value) for name, value in about.items()},
    }


def stated(wiring: Wiring, session: str, trial: str) -> dict[str, dict[str, str]]:
    """The part of it that needs no bench: whose it is, when it began, and the wiring."""
    return {
        "recording": {
            "session": session,
            "trial": trial,
            "software": f"tissue-rig {rig.__version__}",
            "wall_start_iso": datetime.now(UTC).isoformat(),
            "wall_start_ns": str(time.time_ns()),
            "monotonic_start_ns": str(time.monotonic_ns()),
        },
        **({METADATA: layouts(brought_by(wiring.input))} if wiring.input else {}),
        "wiring": {name: json.dumps(table) for name, table in wiring.model_dump(mode="json").items()},
        "subject": {name: str(value) for name, value in wiring.subject.model_dump().items()},
    }


def refuse_bench(bench: Supervisor, program: Program) -> None:
    """Raises what the loop would refuse ``program`` for, before a session or a recording is begun for it."""
    force, axis = (Identity(**bench.ready.devices[role]) for role in ("force", "axis"))
    refuse_uncommissioned(program, bench.wiring, force, axis, datetime.now(UTC))


def _calibration(wiring: Wiring) -> dict[str, str]:
    """What readers of force need; the calibrations themselves, with loads and uncertainty, stand in the wiring."""
    return {
        "force_axis": wiring.force.axis,
        "compression": wiring.force.compression,
        "matrix": json.dumps(wiring.force_map.matrix),
    }


def _texts(value: object) -> dict[str, str]:
    items = value.items() if isinstance(value, Mapping) else [("value", value)]
    return {str(key): item if isinstance(item, str) else json.dumps(item) for key, item in items}


def record(bench: Supervisor, program: Program, file: Path, about: Metadata, timeout_s: float) -> Recorded:
    """Runs ``program`` while everything is recorded into ``file``.

    A recorder that fails stops the motion. The recording is closed with the outcome, also where the loop is lost; the
    error is raised after that.
    """
    recorder = bench.recorder
    if recorder is None:
        raise DeviceError("the bench is not running")
    recorder.open(file, {**about, "program": {"steps": program.model_dump_json()}})
    time.sleep(LEAD_S)
    try:
        outcome = _run_watched(bench, program, timeout_s)
    except RigError as error:
        _close(bench, {"outcome": "failed", "cause": str(error)})
        raise
    closed = _close(bench, _summary(outcome))
    return Recorded(file, outcome, closed.samples if closed else {}, closed.dropped if closed else {})


def _run_watched(bench: Supervisor, program: Program, timeout_s: float) -> Outcome:
    over = threading.Event()
    failures: list[str] = []
    watcher = threading.Thread(
        target=_stop_without_recorder, args=(bench, over, failures), name="recorder-watch", daemon=True
    )
    watcher.start()
    try:
        outcome = bench.run(program, timeout_s)
        bench.wait_at_rest()
    finally:
        over.set()
        watcher.join()
    if failures:
        raise RecordingFailed(failures[0])
    # A stop is told when it comes; force goes on rising until the axis stands.
    return replace(outcome, peak_force_N=max(outcome.peak_force_N, bench.status.get("peak_force_N") or 0.0))


def _stop_without_recorder(bench: Supervisor, over: threading.Event, failures: list[str]) -> None:
    """Stops the motion as soon as the recorder fails: nothing moves unrecorded."""
    while not over.wait(LOOK_S):
        failure = bench.recorder.failure if bench.recorder else "the recorder is gone"
        if failure:
            failures.append(failure)
            bench.stop(StopReason.RECORDING_LOST)
            return


def _close(bench: Supervisor, summary: dict[str, str]) -> Closed | None:
    try:
        return bench.recorder.close(summary) if bench.recorder else None
    except RecordingFailed:
        if summary["outcome"] == "failed":
            return None
        raise


def _summary(outcome: Outcome) -> dict[str, str]:
    return {
        "outcome": outcome.outcome,
        "cause": outcome.cause,
        "peak_force_N": repr(outcome.peak_force_N),
        "surface_mm": "" if outcome.surface_mm is None else repr(outcome.surface_mm),
        "force_zero_N": "" if outcome.zero_N is None else repr(outcome.zero_N),
        "contact": json.dumps({"method": CONTACT_METHOD} | asdict(outcome.touch)) if outcome.touch else "",
        "wire_damage": json.dumps(dict(outcome.wire_damage)),
        "carried": json.dumps(asdict(outcome.carried)),
    }
