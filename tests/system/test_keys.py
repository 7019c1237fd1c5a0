"""Keys that stop, pressed at any moment of a capture: a stop that is told by name, and an end that is defined."""

import os
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from api.cli.live import NAMES
from controller.stop.word import StopReason
from mock_devices.testing.commands import (
    PATIENCE_S,
    Running,
    ServedBench,
    children,
    freed,
    homing,
    pressed,
    stands_still,
    until,
)
from rig.recording.reader import read_recording
from rig.recording.ring import new_path
from rig.recording.sessions import SESSION_FILE, open_session

pytestmark = pytest.mark.bench
SEED = 1
IN_CI, BY_HAND = 2, 10
KEYS = {"p": StopReason.PAIN, " ": StopReason.EMERGENCY, "s": StopReason.STOP}
# Three, so that none of the moments below lies behind the last.
PROTOCOL = (
    'kind = "indentation"\nspeeds_mm_s = [10]\ntrials = 3\ndepth_mm = 6\nair_dwell_s = 0.3\napproach_speed_mm_s = 20\n'
    "hold_s = 0.5\nretract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 12\n[quality]\nrepeats = 0\n"
)


def approaching(bench: ServedBench, session: Path) -> None:
    until((session / "trial_001.mcap").exists, PATIENCE_S, "the first trial")


def loading(bench: ServedBench, session: Path) -> None:
    pressed(bench, 0.3)


def retreating(bench: ServedBench, session: Path) -> None:
    pressed(bench, 2.0)
    freed(bench)


def between(bench: ServedBench, session: Path) -> None:
    until(lambda: (session / "trial_001.mcap").exists() and open_session(session).trials, PATIENCE_S, "a trial ended")


PHASES: dict[str, Callable[[ServedBench, Path], None]] = {
    "homing": lambda bench, _: homing(bench),
    "approaching": approaching,
    "loading": loading,
    "retreating": retreating,
    "between": between,
}
LONGEST_WAIT_S = 0.8


def moments() -> list[object]:
    """Key, phase and time after its beginning, drawn for each key by itself; every phase comes up in CI."""
    found: list[object] = []
    for place, key in enumerate(KEYS):
        draw = random.Random(SEED + place)
        phases = list(PHASES)[IN_CI * place :] + list(PHASES)[: IN_CI * place]
        for number in range(IN_CI + BY_HAND):
            phase, wait_s = phases[number % len(phases)], round(draw.uniform(0.0, LONGEST_WAIT_S), 3)
            mark = pytest.mark.extra if number < IN_CI else pytest.mark.by_hand
            found.append(pytest.param(key, phase, wait_s, marks=mark, id=f"{KEYS[key].name}-{phase}-{wait_s}"))
    return found


@pytest.mark.parametrize(("key", "phase", "wait_s"), moments())
def test_a_key_stops_a_capture_whenever_it_is_pressed(
    bench: ServedBench, tmp_path: Path, key: str, phase: str, wait_s: float
) -> None:
    (tmp_path / "three.toml").write_text(PROTOCOL)
    session = tmp_path / "session"
    keyboard, terminal = os.openpty()
    running = Running(
        ["capture", tmp_path / "three.toml", "--out", session, *bench.settings("stop.port=0")], tmp_path, stdin=terminal
    )
    PHASES[phase](bench, session)
    after_s = bench.control.number("time_s") + wait_s
    until(lambda: bench.control.number("time_s") > after_s, PATIENCE_S, "the moment of the press")
    os.write(keyboard, key.encode())
    said = running.end()
    os.close(keyboard)
    os.close(terminal)
    assert said.code == 3, said.err
    assert f"{NAMES[KEYS[key]]}: " in said.err and said.sentence, said.err
    stands_still(bench)
    if key != " ":
        assert bench.control.number("tip.force_N") == 0.0
    nothing_half_written(session)
    assert children(running.process.pid, "") == []
    assert not list(new_path().parent.glob(f"tissue-rig-{os.getuid()}-{running.process.pid}-*"))


def nothing_half_written(session: Path) -> None:
    """The list names every recording, each as it was closed, and nothing else is there; or there is no session yet."""
    if not session.exists():
        return
    found = open_session(session)
    assert found.mismatches == () and found.remarks == ()
    assert {path.name for path in session.iterdir()} == {SESSION_FILE, *(trial.file for trial in found.trials)}
    for trial in found.trials:
        recording = read_recording(session / trial.file)
        assert recording.complete and recording.damage == ()
    assert all(trial.outcome == "complete" for trial in found.trials[:-1])
