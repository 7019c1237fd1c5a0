"""Force control through processes and wires: what stops it from outside, and how fast."""

import os
import signal
import threading
from pathlib import Path

import numpy as np
import pytest

from api.cli.mock_bench import plug_into
from controller.experiments import threshold
from controller.supervisor import Supervisor
from mock_devices.testing.commands import PATIENT, Running, ServedBench, children, freed, pressed
from mock_devices.testing.models import index_model
from rig.config.table import merged, parse
from rig.config.wiring import Wiring
from rig.recording.reader import read_recording

pytestmark = pytest.mark.extra
HEARTBEAT_S = 0.2


@pytest.fixture
def tracking(bench: ServedBench, tmp_path: Path) -> Running:
    """A press of 1 to 3 N, over and over, so that the tip moves whenever something happens."""
    model = tmp_path / "model.json"
    index_model(0.12, 0.22, 0.01, force_N=11.0).save(model)
    reference = "press:2,base_N=1,frequency_Hz=1,duration_s=30"
    command: list[str | Path] = [
        "track",
        "--model",
        model,
        "--reference",
        reference,
        "--out",
        tmp_path / "session",
        *bench.settings(f"axis.heartbeat_ms={HEARTBEAT_S * 1000:g}"),
    ]
    return Running(command, tmp_path)


def causes(tmp_path: Path) -> str:
    events = read_recording(tmp_path / "session" / "track_001.mcap").events
    return " ".join(f"{event.code}: {event.text}" for event in events)


def positions(bench: ServedBench, for_s: float) -> list[tuple[float, float]]:
    """Bench time and true axis position, as often as the bench answers."""
    found: list[tuple[float, float]] = []
    while not found or found[-1][0] < found[0][0] + for_s:
        now = bench.control.get("time_s", "axis.position_mm")
        found.append((float(now["time_s"]), float(now["axis.position_mm"])))
    return found


def test_a_killed_loop_in_contact_leaves_the_tip_stopped_within_two_heartbeats(
    bench: ServedBench, tracking: Running, tmp_path: Path
) -> None:
    pressed(bench, 1.5)
    (loop,) = children(tracking.process.pid, "controller.loop.process")
    os.kill(loop, signal.SIGKILL)
    after = positions(bench, 1.0)
    killed_s, (_, final_mm) = after[0][0], after[-1]
    late = [mm for time_s, mm in after if time_s > killed_s + 2 * HEARTBEAT_S]
    assert max(abs(mm - final_mm) for mm in late) < 0.02
    assert bench.control.get("axis.powered")["axis.powered"] is False
    assert tracking.end().code == 1


def test_a_command_that_is_suspended_loses_its_lease_and_the_tip_retracts(
    bench: ServedBench, tracking: Running, tmp_path: Path
) -> None:
    pressed(bench)
    tracking.process.send_signal(signal.SIGSTOP)
    freed(bench)
    tracking.process.send_signal(signal.SIGCONT)
    said = tracking.end()
    assert said.code == 3
    assert "the operator's program is silent" in said.sentence
    assert "operator_silent" in causes(tmp_path)


def test_a_threshold_session_ends_where_the_subject_stops_it(bench: ServedBench, tmp_path: Path) -> None:
    model = index_model(0.12, 0.22, 0.01, force_N=11.0)
    wiring = plug_into(parse(Wiring, merged({}, PATIENT), "PATIENT"), bench.endpoints)
    program = threshold.plan(8.0, 1.0, model, wiring)
    pressed_N: list[float] = []

    def press_the_key() -> None:
        pressed(bench, 2.0)
        pressed_N.append(bench.control.number("tip.force_N"))
        rig.pain()

    with Supervisor(wiring) as rig:
        presses = threading.Thread(target=press_the_key)
        presses.start()
        found = threshold.run(rig, program, 8.0, tmp_path / "session", "")
        presses.join()
    highest_N = np.nanmax(read_recording(tmp_path / "session" / found.recording).tables["loop"]["force_N"])
    assert found.force_N is not None
    assert pressed_N[0] - 0.2 < found.force_N <= highest_N < pressed_N[0] + 2.0
    freed(bench)


def test_a_limb_that_is_pulled_away_ends_the_run(bench: ServedBench, tracking: Running, tmp_path: Path) -> None:
    pressed(bench)
    bench.control.set({"surface.position_mm": 34.0})
    said = tracking.end()
    assert said.code == 3
    assert "the limb is gone, or a force channel died" in said.sentence
    assert "contact_lost" in causes(tmp_path)
