"""One trial: a fresh bench, a scenario, a fault at a moment that seed, fault and number say, and what came of it."""

import contextlib
import os
import random
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from api.cli.mock_bench import plug_into
from api.cli.mock_inputs import input_options
from benchmarks.faults.evaluation import Notice, Outcome, evaluate
from benchmarks.faults.fault import DRIVE, Fault, at_once
from benchmarks.faults.observer import Observer
from benchmarks.faults.program import Program, program
from benchmarks.faults.scenarios import SCENARIOS, Ended
from mock_devices.testing.commands import ServedBench, served_bench
from rig.config.table import merged, parse
from rig.config.wiring import Wiring
from rig.errors import RigError
from rig.recording.reader import Recording, read_recording

# Every limit of a real bench is stated, so that none is as patient as a mock device gets it; only missed samples are
# counted by age, because the bench is a process of the same computer.
STATED = ("loop.missed_periods=0",)
READY_S = 30.0
REST_S, STILL_MM = 0.3, 0.03
# Out of the deepest trial at the retraction's 20 mm/s, and back.
WAY_OUT_S = 3.0
# Part 1 of the limits: a peak may pass the force limit by a tenth, while the axis comes to stand.
MARGIN = 1.1
# An event carries the time at which its cycle began, which may be just before what it answers.
CYCLE_NS = 2_000_000
STOPPING_LEVEL = 30
# After a fault at rest nothing ends by itself: so long its notice is awaited.
AT_REST_S = 1.5


@dataclass(frozen=True)
class Trial:
    """What one fault did once; times in s from the fault or its onset, forces are the tissue's own."""

    fault: str
    number: int
    plant: str
    commit: str
    moment_s: float
    noticed_by: str
    detected_s: float | None
    unnoticed: str
    unsafe: str
    peak_N: float
    over_N: float
    end: str
    cause: str
    complete: bool
    attempts: int = 1


class Spoilt(RigError):
    """The run had ended before its fault: the computer stalled, or the moment came too late."""


def wiring_for(fault: Fault) -> Wiring:
    """The bench's configuration in a trial of ``fault``."""
    return parse(Wiring, merged(Wiring().model_dump(mode="json"), [*STATED, *fault.settings]), fault.name)


def trial(
    fault: Fault, number: int, seed: int, folder: Path, plant: str = "", planted: str = "", final: bool = True
) -> Trial:
    """Runs ``fault`` once; ``planted`` are the checks that ``plant`` switches off in the loop.

    Raises Spoilt where the run did not live to see its fault, and, unless this is the ``final`` attempt, where a stall
    of the computer stopped it before what is declared for the fault could.
    """
    moment_s = random.Random(f"{seed} {fault.name} {number}").uniform(0.0, fault.latest_s)
    with (
        served_bench("--seed", str(seed + number), *input_options(wiring_for(fault))) as bench,
        contextlib.closing(Observer(bench.endpoints.control)) as observer,
    ):
        outcome = _outcome(fault, bench, folder, planted, observer, moment_s)
    found = evaluate(fault, outcome)
    if found.unnoticed and not (final or fault.freezes) and outcome.stops and outcome.stops[0].is_stall:
        raise Spoilt(outcome.stops[0].text)
    over_N = max(0.0, observer.peak_N - MARGIN * wiring_for(fault).force_limit_N)
    unsafe = [outcome.moves, f"{over_N:.2f} N over the limit and its margin" if over_N else ""]
    return Trial(
        fault=fault.name,
        number=number,
        plant=plant,
        commit=commit(),
        moment_s=round(moment_s, 3),
        noticed_by=found.by,
        detected_s=found.detected_s,
        unnoticed=found.unnoticed,
        unsafe="; ".join(part for part in unsafe if part),
        peak_N=round(observer.peak_N, 3),
        over_N=round(over_N, 3),
        end=outcome.end,
        cause=outcome.ended.cause,
        complete=outcome.complete,
    )


def _outcome(
    fault: Fault, bench: ServedBench, folder: Path, planted: str, observer: Observer, moment_s: float
) -> Outcome:
    happened_ns, refusal, unpowered_ns, notices = time.monotonic_ns(), "", None, list[Notice]()
    try:
        wiring = plug_into(_with_keypad(wiring_for(fault), fault, folder), bench.endpoints)
        with program(bench, wiring, fault, folder, planted) as running:
            observer.listen(running.live.rig)
            if DRIVE in planted.split(","):
                bench.control.fault("axis", "unguarded")
            happened_ns, refusal = _provoke(fault, running, observer, moment_s)
            ended = running.wait()
            _await_notice(fault, observer, happened_ns)
            unpowered_ns, notices = observer.unpowered_ns, list(observer.notices)
            end, moves = _end(bench)
    except RigError as error:
        if not fault.before:
            raise
        ended, refusal = Ended(str(error)), str(error)
        end, moves = _end(bench)
    recordings = [read_recording(file) for file in sorted(folder.glob("*.mcap"))]
    found = [*_recorded(recordings, happened_ns), *(one for one in notices if one.at_ns > happened_ns)]
    stops = tuple(sorted(found, key=lambda notice: notice.at_ns))
    onset_ns = happened_ns if fault.onset is at_once else observer.onset_ns
    if fault.stream and stops:
        onset_ns = last_sample_ns(recordings, fault.stream, stops[0].at_ns)
    return Outcome(
        ended,
        happened_ns,
        onset_ns,
        stops,
        unpowered_ns,
        refusal,
        end,
        moves,
        all(recording.complete and not recording.damage for recording in recordings),
    )


def _provoke(fault: Fault, running: Program, observer: Observer, moment_s: float) -> tuple[int, str]:
    """When the fault was brought about, and the sentence that refused it, if one did."""
    if not fault.before:
        running.begin()
        _wait(lambda: _is_ready(fault, running, observer))
        time.sleep(moment_s)
        if not _at_rest(fault) and (running.ended or observer.notices):
            raise Spoilt(running.ended.cause if running.ended else observer.notices[0].code)
    happened_ns = time.monotonic_ns()
    observer.expect(fault.onset)
    refusal = ""
    try:
        fault.act(running.live)
    except RigError as error:
        refusal = str(error)
    running.begin()
    return happened_ns, refusal


def _with_keypad(wiring: Wiring, fault: Fault, folder: Path) -> Wiring:
    if not fault.keypad:
        return wiring
    os.mkfifo(folder.with_name("keypad"))
    settings = wiring.stop.model_copy(update={"keypad": str(folder.with_name("keypad"))})
    return wiring.model_copy(update={"stop": settings})


def _is_ready(fault: Fault, running: Program, observer: Observer) -> bool:
    if _at_rest(fault):
        return running.ended is not None
    return running.ended is not None or SCENARIOS[fault.scenario].ready(observer.truth)


def _at_rest(fault: Fault) -> bool:
    return fault.scenario in SCENARIOS and SCENARIOS[fault.scenario].at_rest


def _await_notice(fault: Fault, observer: Observer, since_ns: int) -> None:
    """A run at rest goes on beside its stop; one whose loop was killed ends before the drive misses its heartbeat."""
    until_s = time.monotonic() + AT_REST_S
    while time.monotonic() < until_s:
        told = not _at_rest(fault) or any(one.at_ns > since_ns for one in observer.notices)
        if told and not (fault.expected == (DRIVE,) and observer.unpowered_ns is None):
            return
        time.sleep(0.01)


def _wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + READY_S
    while not condition():
        if time.monotonic() > deadline:
            raise Spoilt(f"the bench was not ready for its fault within {READY_S:g} s")
        time.sleep(0.003)


def _recorded(recordings: Sequence[Recording], happened_ns: int) -> list[Notice]:
    """What stopped motion, from the events of the recordings."""
    return [
        Notice(event.code, event.capture_ns, event.text)
        for recording in recordings
        for event in recording.events
        if event.level >= STOPPING_LEVEL and event.capture_ns > happened_ns - CYCLE_NS
    ]


def last_sample_ns(recordings: Sequence[Recording], stream: str, before_ns: int) -> int:
    """When the newest sample of ``stream`` was taken that had come by then, of all recordings."""
    found = np.concatenate([recording.tables[stream] for recording in recordings])
    return int(found["capture_ns"][found["arrival_ns"] < before_ns].max())


def _end(bench: ServedBench) -> tuple[str, str]:
    """Where it ended, and what is unsafe about it: the way out takes a while, but it has an end."""
    until_s = time.monotonic() + WAY_OUT_S
    moved_mm = _moved_mm(bench)
    while moved_mm > STILL_MM and time.monotonic() < until_s:
        moved_mm = _moved_mm(bench)
    now = bench.control.get("tip.force_N", "axis.powered")
    place = "free" if float(now["tip.force_N"]) == 0 else "stopped in contact"
    place += ", powered" if now["axis.powered"] else ", braked"
    return place, f"still moves, {moved_mm:.2f} mm in {REST_S:g} s" if moved_mm > STILL_MM else ""


def _moved_mm(bench: ServedBench) -> float:
    before_mm = bench.control.number("tip.position_mm")
    time.sleep(REST_S)
    return abs(bench.control.number("tip.position_mm") - before_mm)


def commit() -> str:
    """The version that is tried, with a plus where files differ from it."""
    said = subprocess.run(["git", "describe", "--always", "--dirty=+"], capture_output=True, text=True, check=False)
    return said.stdout.strip() or "unknown"
