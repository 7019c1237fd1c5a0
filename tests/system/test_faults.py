"""What goes wrong on a bench, once each, through real processes and wires: a safe end, one sentence, nothing lost."""

import os
import resource
import signal
from pathlib import Path

import pytest

from mock_devices.testing.commands import (
    EXAMPLES,
    Running,
    Said,
    ServedBench,
    children,
    freed,
    pressed,
    rig,
    stands_still,
    until,
)
from rig.recording.reader import read_recording
from rig.recording.sessions import open_session

LOOP, RECORDER = "controller.loop.process", "rig.recording.recorder"
SURFACE_MM = 20.0


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    """One slow trial: time enough for something to happen during it."""
    path = tmp_path / "slow.toml"
    path.write_text(
        'kind = "indentation"\nspeeds_mm_s = [5]\ntrials = 1\ndepth_mm = 8\nair_dwell_s = 0.2\n'
        "approach_speed_mm_s = 20\nhold_s = 20\nretract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 12\n"
    )
    return path


def capture(bench: ServedBench, protocol: Path, tmp_path: Path, *more: str) -> Running:
    return Running(["capture", protocol, "--out", tmp_path / "session", *bench.settings(*more)], tmp_path)


def ended_safely(said: Said, tmp_path: Path, code: int, *words: str) -> None:
    """Exit code and sentence; the recording opens and holds the cause."""
    assert said.code == code, said.err
    assert all(word in said.sentence for word in words), said.sentence
    recording = read_recording(tmp_path / "session" / "trial_001.mcap")
    assert len(recording.tables["loop"]) > 100
    assert recording.damage == ()


def recorded_cause(tmp_path: Path) -> str:
    events = read_recording(tmp_path / "session" / "trial_001.mcap").events
    return " ".join(f"{event.code}: {event.text}" for event in events)


# --- before anything moves -------------------------------------------------------------------------------------------


def test_a_port_that_does_not_exist(bench: ServedBench, protocol: Path, tmp_path: Path) -> None:
    said = capture(bench, protocol, tmp_path, "force.port=/dev/ttyUSB99").end()
    assert said.code == 1
    assert "/dev/ttyUSB99: cannot be opened" in said.sentence
    assert not (tmp_path / "session").exists()


def test_a_tracker_that_is_absent(bench: ServedBench, protocol: Path, tmp_path: Path) -> None:
    said = capture(bench, protocol, tmp_path, "tracker.port=tcp://127.0.0.1:9").end()
    assert said.code == 1
    assert "tcp://127.0.0.1:9: no connection" in said.sentence


def test_the_wrong_device_behind_a_port(bench: ServedBench, protocol: Path, tmp_path: Path) -> None:
    ports = bench.endpoints.devices
    said = capture(bench, protocol, tmp_path, f"force.port={ports['tracker']['serial']}").end()
    assert said.code == 1
    assert "Bota" in said.sentence or "bota" in said.sentence


def test_a_device_that_is_silent(bench: ServedBench, protocol: Path, tmp_path: Path) -> None:
    bench.control.fault("axis", "silent", True)
    said = capture(bench, protocol, tmp_path).end()
    assert said.code == 1
    assert "axis" in said.sentence or "EPOS4" in said.sentence


def test_an_unknown_configuration_key_names_the_nearest_valid_one(tmp_path: Path) -> None:
    wiring = tmp_path / "rig.toml"
    wiring.write_text('[force]\nprot = "/dev/ttyUSB0"\n')
    said = rig("doctor", "--config", wiring, folder=tmp_path)
    assert said.code == 2
    assert "unknown key force.prot; nearest valid key: port" in said.sentence


def test_limits_that_contradict_each_other(tmp_path: Path) -> None:
    wiring = tmp_path / "rig.toml"
    wiring.write_text("[limits]\nposition_min_mm = 30\nposition_max_mm = 20\n")
    said = rig("doctor", "--config", wiring, folder=tmp_path)
    assert said.code == 2
    assert "position_min_mm 30 is not below position_max_mm 20" in said.sentence


def test_a_protocol_beyond_the_limits_is_refused_before_anything_is_opened(tmp_path: Path) -> None:
    said = rig(
        "capture", EXAMPLES / "indentation.toml", "--out", tmp_path / "session", "--set", "limits.depth_mm=5",
        "--set", "force.port=/dev/not-even-looked-at", folder=tmp_path,
    )  # fmt: skip
    assert said.code == 2
    assert "8 mm deep, above limits.depth_mm 5 mm" in said.sentence
    assert not (tmp_path / "session").exists()


def test_a_second_user_is_told_that_the_bench_is_taken(bench: ServedBench, protocol: Path, tmp_path: Path) -> None:
    first = capture(bench, protocol, tmp_path)
    pressed(bench)
    second = rig("capture", protocol, "--out", tmp_path / "second", *bench.settings(), folder=tmp_path)
    assert second.code == 1
    assert "is in use by" in second.sentence
    first.interrupt()
    assert first.end().code == 3
    freed(bench)


# --- while the tip presses -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("device", "kind", "words"),
    [
        ("force", "cut", ("force",)),
        pytest.param("force", "freeze", ("force", "old"), marks=pytest.mark.by_hand),
        pytest.param("force", "frozen", ("frozen",), marks=pytest.mark.by_hand),
        pytest.param("force", "invalid", ("invalid",), marks=pytest.mark.by_hand),
        ("tracker", "cut", ("tracker",)),
    ],
)
def test_a_lost_input_retracts_and_says_which(
    bench: ServedBench, protocol: Path, tmp_path: Path, device: str, kind: str, words: tuple[str, ...]
) -> None:
    running = capture(bench, protocol, tmp_path)
    pressed(bench)
    bench.control.fault(device, kind, True)
    freed(bench)
    ended_safely(running.end(), tmp_path, 3, *words)
    assert device in recorded_cause(tmp_path)


def test_a_cut_cable_of_the_axis_ends_with_the_drive_stopped_by_itself(
    bench: ServedBench, protocol: Path, tmp_path: Path
) -> None:
    running = capture(bench, protocol, tmp_path)
    pressed(bench)
    bench.control.fault("axis", "cut", True)
    ended_safely(running.end(), tmp_path, 3, "axis lost")
    stands_still(bench)


def test_an_axis_that_goes_on_naming_one_place_is_stopped(bench: ServedBench, protocol: Path, tmp_path: Path) -> None:
    running = capture(bench, protocol, tmp_path)
    pressed(bench)
    bench.control.fault("axis", "frozen", True)
    ended_safely(running.end(), tmp_path, 3, "position is frozen")
    stands_still(bench)


def test_a_drive_fault_stops_at_once(bench: ServedBench, protocol: Path, tmp_path: Path) -> None:
    running = capture(bench, protocol, tmp_path)
    pressed(bench)
    bench.control.fault("axis", "error", 0x2310)
    ended_safely(running.end(), tmp_path, 3, "drive reports")
    stands_still(bench)


def test_the_limb_pressing_back_beyond_the_limit_retracts(bench: ServedBench, protocol: Path, tmp_path: Path) -> None:
    running = capture(bench, protocol, tmp_path, "limits.force_N=13")
    pressed(bench, 4.0)
    bench.control.set({"tissue.stiffness_scale": 4.0})
    freed(bench)
    ended_safely(running.end(), tmp_path, 3, "force", "limits.force_N, 13 N")


def test_ctrl_c_retracts_and_keeps_what_was_recorded(bench: ServedBench, protocol: Path, tmp_path: Path) -> None:
    running = capture(bench, protocol, tmp_path)
    pressed(bench)
    running.interrupt()
    freed(bench)
    ended_safely(running.end(), tmp_path, 3, "stopped by the operator")
    assert open_session(tmp_path / "session").trials[0].outcome == "operator_stop"


@pytest.mark.parametrize(
    ("key", "cause"),
    [
        pytest.param("p", "pain stop", marks=pytest.mark.by_hand),
        (" ", "emergency stop"),
        pytest.param("s", "by the operator", marks=pytest.mark.by_hand),
    ],
)
def test_a_key_in_the_terminal_stops(bench: ServedBench, protocol: Path, tmp_path: Path, key: str, cause: str) -> None:
    ours, theirs = os.openpty()
    arguments: list[str | Path] = ["capture", protocol, "--out", tmp_path / "session", *bench.settings()]
    running = Running(arguments, tmp_path, stdin=theirs)
    pressed(bench)
    os.write(ours, key.encode())
    ended_safely(running.end(), tmp_path, 3, cause)
    stands_still(bench)
    os.close(ours)
    os.close(theirs)


def test_a_full_disk_stops_the_motion_and_keeps_the_good_part(
    bench: ServedBench, protocol: Path, tmp_path: Path
) -> None:
    running = capture(bench, protocol, tmp_path)
    pressed(bench)
    (recorder,) = children(running.process.pid, RECORDER)
    resource.prlimit(recorder, resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
    freed(bench)
    ended_safely(running.end(), tmp_path, 1, "trial_001.mcap")


def test_a_killed_loop_leaves_a_stopped_drive_and_an_open_recording(
    bench: ServedBench, protocol: Path, tmp_path: Path
) -> None:
    running = capture(bench, protocol, tmp_path)
    pressed(bench)
    (loop,) = children(running.process.pid, LOOP)
    os.kill(loop, signal.SIGKILL)
    ended_safely(running.end(), tmp_path, 1, "killed by signal 9")
    stands_still(bench)


def test_a_killed_recorder_stops_the_motion(bench: ServedBench, protocol: Path, tmp_path: Path) -> None:
    running = capture(bench, protocol, tmp_path)
    pressed(bench)
    (recorder,) = children(running.process.pid, RECORDER)
    os.kill(recorder, signal.SIGKILL)
    freed(bench)
    ended_safely(running.end(), tmp_path, 1, "the recorder process ended")


def test_a_killed_command_leaves_a_retracted_tip_and_a_finished_recording(
    bench: ServedBench, protocol: Path, tmp_path: Path
) -> None:
    running = capture(bench, protocol, tmp_path)
    pressed(bench)
    helpers = children(running.process.pid, LOOP) + children(running.process.pid, RECORDER)
    running.process.kill()
    running.end()
    freed(bench)
    until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in helpers), 30, "loop and recorder gone")
    recording = read_recording(tmp_path / "session" / "trial_001.mcap")
    assert recording.complete
    assert "supervisor_lost" in recorded_cause(tmp_path)
