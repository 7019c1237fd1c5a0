"""A recording alone is enough to decide all of it again, bit by bit; what was changed since is found at its row."""

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from controller.loop.modes import Mode
from controller.loop.steps import Approach, Compress, Hold, MoveTo, Program, Retract, Zero
from controller.replay import session as replaying
from controller.replay.given import given_by
from controller.replay.session import replay_recording
from controller.safety import checks, load
from controller.safety.table import TABLE
from rig.channels import EventSample
from rig.errors import DataError
from rig.recording.reader import Recording
from tests.controller.fake_bench import APPROACH, HOLD, LEAVE, PRESS, ZERO, FakeBench, wired
from tests.controller.replay.made import begin, recorded, without

WHOLE = (ZERO, APPROACH, PRESS, Hold(duration_s=0.2), LEAVE)


def near(sensor_Hz: float = 1000.0, position_mm: float = 17.5, **sections: dict[str, float]) -> FakeBench:
    """A bench whose tip is not far from the limb, so that a trial takes a second."""
    return FakeBench(wired(sensor_Hz, **sections), position_mm=position_mm)


def whole(bench: FakeBench) -> Recording:
    """A trial from rest to rest."""
    ended = len(bench.link.of("finished"))
    program = begin(bench, *WHOLE)
    bench.until(lambda: len(bench.link.of("finished")) > ended)
    bench.wait(0.1)
    return recorded(bench, program)


@pytest.fixture(scope="module")
def trial() -> Recording:
    """One trial."""
    return whole(near())


def stopped(bench: FakeBench, fault: Callable[[FakeBench], object], code: str) -> Recording:
    """Pressing, then a fault, until the axis stands."""
    program = begin(bench, ZERO, APPROACH, PRESS, HOLD)
    bench.until(lambda: bench.loop.machine.step_index == 3)
    bench.wait(0.1)
    fault(bench)
    bench.until(lambda: bench.latched == code)
    bench.until(lambda: bench.mode is Mode.SAFE)
    bench.wait(0.05)
    return recorded(bench, program)


@pytest.mark.parametrize("sensor_Hz", [1000.0, pytest.param(100.0, marks=pytest.mark.extra)])
def test_a_trial_is_decided_again_as_it_was(sensor_Hz: float, trial: Recording) -> None:
    recording = trial if sensor_Hz == 1000.0 else whole(near(sensor_Hz))
    found = replay_recording(recording)
    assert [one.sentence for one in found.differences] == []
    assert (found.differing_rows, found.stops, found.given) == (0, (), ())
    assert found.rows == len(recording.tables["loop"]) and found.compared > 0.9 * (found.rows - 200)


def test_what_programs_before_left_behind_is_carried() -> None:
    """The second trial counts force from the zero of the first until it has its own."""
    bench = near()
    whole(bench)
    again = whole(bench)
    assert replay_recording(again).differing_rows == 0
    forgot = replay_recording(without(again, "summary"))
    assert forgot.differing_rows > 0
    assert forgot.differences[0].field == "force_N" and forgot.differences[0].replayed == "nan"


def cut(role: str) -> Callable[[FakeBench], object]:
    return lambda bench: setattr(getattr(bench, role), "cut", f"{role}: the line is gone")


FAULTS: dict[str, tuple[Callable[[FakeBench], object], str]] = {
    "emergency stop": (lambda bench: bench.say("estop"), "emergency_stop"),
    "pain": (lambda bench: bench.say("pain"), "pain_stop"),
    "operator": (lambda bench: bench.say("stop"), "operator_stop"),
    "keypad gone": (lambda bench: bench.say("keypad"), "operator_stop"),
    "axis cut": (cut("axis"), "axis_lost"),
    "force cut": (cut("force"), "force_lost"),
    "tracker cut": (cut("tracker"), "tracker_lost"),
    "drive fault": (lambda bench: setattr(bench.axis, "fault_text", "0x8611 following error"), "drive_fault"),
    "recorder silent": (lambda bench: setattr(bench.ring, "silent_s", 7.0), "recorder_stalled"),
    "recorder full": (lambda bench: setattr(bench.ring, "fill", 0.93), "recorder_stalled"),
    "recording lost": (lambda bench: bench.say("recording"), "recorder_stalled"),
    "stop process dead": (lambda bench: setattr(bench, "stop_process_lives", False), "stop_lost"),
    "operator gone": (lambda bench: setattr(bench, "keep_lease", False), "operator_silent"),
    "lease given back": (lambda bench: bench.say("unattended"), "operator_silent"),
    "supervisor dead": (lambda bench: setattr(bench.link, "lost", True), "supervisor_lost"),
    "force silent": (lambda bench: setattr(bench.force, "silent", True), "force_lost"),
    "force frozen": (lambda bench: setattr(bench.force, "frozen", True), "force_invalid"),
    "axis silent": (lambda bench: setattr(bench.axis, "silent", True), "axis_lost"),
    "tracker silent": (lambda bench: setattr(bench.tracker, "silent", True), "tracker_lost"),
    "limb moves": (lambda bench: setattr(bench.tracker, "limb_mm", (20.0, 0.0, 0.0)), "patient_moved"),
    "late": (lambda bench: bench.cycle(late_ns=150_000_000), "axis_lost"),
}


SHOWN = ("force silent", "force frozen", "axis silent", "tracker silent", "limb moves", "late")
# One stop by a person, one lost link and one that samples show; the others take half a minute together.
OFTEN = ("pain", "axis cut", "force frozen")
EACH = [name if name in OFTEN else pytest.param(name, marks=pytest.mark.extra) for name in FAULTS]


@pytest.mark.parametrize("name", EACH)
def test_each_fault_is_replayed_and_its_stop_decided_again(name: str) -> None:
    fault, code = FAULTS[name]
    # Where the limb is, is known after 8 mm of way.
    bench = near(position_mm=10.0) if name == "limb moves" else near()
    found = replay_recording(stopped(bench, fault, code))
    assert [one.sentence for one in found.differences] == []
    assert [stop.partition(":")[0] for stop in found.stops][:1] == [code]
    # What no sample holds is said to be given; what samples show is decided from them.
    assert bool(found.given) == (name not in SHOWN)


@pytest.fixture(scope="module")
def too_much() -> Iterator[Recording]:
    """A compression that would pass the limit of 8 N is stopped by what is foreseen."""
    bench = near(limits={"force_N": 8.0})
    deep = Compress(depth_mm=12.0, speed_mm_s=20.0, force_limit_N=7.9)
    program = begin(bench, ZERO, APPROACH, deep)
    bench.until(lambda: bench.latched == "force_limit")
    bench.until(lambda: bench.mode is Mode.SAFE)
    yield recorded(bench, program)


def test_a_force_limit_is_decided_from_samples_alone(too_much: Recording) -> None:
    found = replay_recording(too_much)
    assert (found.differing_rows, found.given) == (0, ())
    assert found.stops[0].startswith("force_limit: force ")


def test_a_safety_constant_that_was_changed_is_found_at_its_row(
    too_much: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop_ns = next(event.capture_ns for event in too_much.events if event.code == "force_limit")
    stop_row = int(np.searchsorted(too_much.tables["loop"]["capture_ns"], stop_ns))
    monkeypatch.setattr(load, "STIFFENING_PER_MM", 2.0)
    found = replay_recording(too_much)
    assert found.differing_rows > 0
    first = found.differences[0]
    assert (first.field, first.recorded) == ("event", "nothing")
    assert first.row < stop_row and "force_limit: force " in first.replayed
    assert f"row {first.row} (" in first.sentence


def test_other_limits_show_what_would_have_been(too_much: Recording) -> None:
    found = replay_recording(too_much, ["limits.force_N=20", "subject.pain_threshold_N=15"])
    assert found.stops == () or not found.stops[0].startswith("force_limit: force 8")
    assert found.differences and found.differences[0].field in ("event", "mode")


@pytest.mark.extra
def test_a_check_that_is_gone_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = stopped(near(), *FAULTS["force frozen"])
    table = tuple(line for line in TABLE if line.evaluate is not checks.force_invalid)
    found = replay_recording(recording, table=table)
    assert found.differences[0].replayed != found.differences[0].recorded


def test_a_sample_with_one_bit_turned_is_noticed(trial: Recording) -> None:
    """The lowest of the last of the trial, which decides nothing that comes after it."""
    recording = trial
    force = recording.tables["force"].copy()
    force["fz_N"][-2] = np.nextafter(force["fz_N"][-2], np.inf)
    edited = dataclasses.replace(recording, tables={**recording.tables, "force": force})
    found = replay_recording(edited)
    assert (found.differing_rows, found.differences[0].field) == (1, "force_N")


@pytest.mark.parametrize(
    ("part", "sentence"),
    [
        ("program", "trial_001.mcap: holds no program .'program' is missing.: only what this version"),
        ("wiring", "holds no wiring"),
        ("devices", "holds no devices"),
    ],
)
def test_what_is_missing_is_one_sentence(part: str, sentence: str, trial: Recording) -> None:
    with pytest.raises(DataError, match=sentence):
        replay_recording(without(trial, part))


def test_a_program_that_never_began_is_no_replay(trial: Recording) -> None:
    with pytest.raises(DataError, match="its program never began"):
        replay_recording(dataclasses.replace(trial, events=()))


def event(code: str, text: str, level: int = 30) -> EventSample:
    return EventSample(0, 7, 7, level, code, text)


def test_inputs_are_read_from_the_sentences_of_the_checks() -> None:
    """The sentences are those that the checks themselves say."""
    found = given_by([event("recorder_stalled", "the recorder is silent for 3.0 s, its buffer 40 % full")])[7]
    assert (f"{found.recorder_silent_s:.1f}", found.recorder_fill) == ("3.0", 0.4)
    lost = given_by([event("recorder_stalled", "the recording failed, and nothing moves unrecorded")])[7]
    assert (lost.requests, lost.recorder_silent_s, lost.recorder_fill) == (frozenset({"recording"}), 0.0, 0.0)
    keypad = given_by([event("operator_stop", "the keypad or foot switch for stops is gone: plug it in")])[7]
    assert keypad.requests == {"stop", "keypad"}
    old = event("force_lost", "force: newest sample is 60 ms old (limit 50 ms)")
    assert given_by([old, event("note", "x", 10)]) == {}


def test_a_program_of_every_step_keeps_its_numbers() -> None:
    """A program is recorded as text and read back as the same program."""
    moved, away = MoveTo(position_mm=5.1, speed_mm_s=3.3), Retract(clearance_mm=5.0, speed_mm_s=7.7)
    steps = (Zero(duration_s=0.1), moved, APPROACH, PRESS, HOLD, away)
    program = Program(name="all", steps=steps)
    assert Program.model_validate_json(program.model_dump_json()) == program
    assert isinstance(program.steps[2], Approach)


def test_a_file_that_is_no_session_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError):
        replaying.replay(tmp_path / "nothing")
