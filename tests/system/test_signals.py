"""A terminal that is closed and a computer that shuts down: the tip leaves, what homes is braked, recordings are whole.

Ctrl-C in contact is in test_faults, what each process makes of a signal alone in its own tests.
"""

import os
import signal
from pathlib import Path

import pytest

from mock_devices.testing.commands import Running, ServedBench, children, freed, homing, pressed, stands_still
from rig.recording.reader import read_recording
from rig.recording.ring import new_path
from rig.recording.sessions import open_session
from tests.system.presses import SLOW
from tests.system.window import window

pytestmark = pytest.mark.extra
LOOP = "controller.loop.process"
HOMES_SLOWLY = ("axis.homing_speed_mm_s=2", "stop.port=0")


def capture(bench: ServedBench, tmp_path: Path, *more: str, terminal: int | None = None) -> Running:
    (tmp_path / "slow.toml").write_text(SLOW)
    words: tuple[str | Path, ...] = ("capture", tmp_path / "slow.toml", "--out", tmp_path / "session")
    return Running([*words, *bench.settings(*more)], tmp_path, terminal=terminal)


def stopped_and_whole(tmp_path: Path, outcome: str) -> None:
    session = open_session(tmp_path / "session")
    assert [trial.outcome for trial in session.trials] == [outcome]
    assert session.mismatches == ()
    recording = read_recording(tmp_path / "session" / "trial_001.mcap")
    assert recording.complete and recording.damage == ()
    assert outcome in [event.code for event in recording.events]


def nothing_left(running: Running) -> None:
    pid = running.process.pid
    assert children(pid, "") == []
    assert not list(new_path().parent.glob(f"tissue-rig-{os.getuid()}-{pid}-*"))


def test_a_terminal_closed_in_contact_leaves_the_tip_outside_and_the_recording_whole(
    bench: ServedBench, tmp_path: Path
) -> None:
    with window() as terminal:
        running = capture(bench, tmp_path, terminal=terminal.terminal)
        pressed(bench)
        terminal.close()
        freed(bench)
        assert running.end().code == 3
    stopped_and_whole(tmp_path, "operator_stop")
    nothing_left(running)


def test_a_terminal_closed_while_the_axis_homes_has_it_braked(bench: ServedBench, tmp_path: Path) -> None:
    bench.control.set({"surface.position_mm": 60.0})
    with window() as terminal:
        running = capture(bench, tmp_path, *HOMES_SLOWLY, terminal=terminal.terminal)
        homing(bench)
        terminal.close()
        assert running.end().code == 130
    ended_before_it_began(bench, running, tmp_path)


def ended_before_it_began(bench: ServedBench, running: Running, tmp_path: Path) -> None:
    stands_still(bench)
    assert bench.control.get("axis.powered")["axis.powered"] is False
    assert not (tmp_path / "session").exists()
    nothing_left(running)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_command_told_to_end_while_the_axis_homes_brakes_it(
    bench: ServedBench, tmp_path: Path, number: signal.Signals
) -> None:
    bench.control.set({"surface.position_mm": 60.0})
    running = capture(bench, tmp_path, *HOMES_SLOWLY)
    homing(bench)
    running.process.send_signal(number)
    said = running.end()
    assert (said.code, said.err) == (130, "")
    ended_before_it_began(bench, running, tmp_path)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_loop_told_to_end_in_contact_retracts_by_name(
    bench: ServedBench, tmp_path: Path, number: signal.Signals
) -> None:
    running = capture(bench, tmp_path)
    pressed(bench)
    (loop,) = children(running.process.pid, LOOP)
    os.kill(loop, number)
    freed(bench)
    said = running.end()
    assert said.code == 3 and "stopped by the operator" in said.sentence, said.err
    stopped_and_whole(tmp_path, "operator_stop")


def test_a_loop_told_to_end_while_the_axis_homes_brakes_it(bench: ServedBench, tmp_path: Path) -> None:
    bench.control.set({"surface.position_mm": 60.0})
    running = capture(bench, tmp_path, *HOMES_SLOWLY)
    homing(bench)
    (loop,) = children(running.process.pid, LOOP)
    os.kill(loop, signal.SIGTERM)
    said = running.end()
    assert said.code == 3 and "stopped on request while it was moved" in said.sentence, said.err
    ended_before_it_began(bench, running, tmp_path)
