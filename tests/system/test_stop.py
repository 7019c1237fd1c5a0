"""The stop process beside a real service and loop: whatever becomes of the service, a press reaches the loop."""

import http.client
import json
import os
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from api.cli.mock_bench import plug_into
from api.cli.options import built_in
from api.http.priority import NICE, PRIORITY
from controller.stop.start import SENTENCE
from controller.stop.word import NOT_CONFIRMED, Deed, StopReason
from controller.supervisor import Supervisor
from mock_devices.testing.commands import (
    PATIENCE_S,
    PATIENT,
    Running,
    ServedBench,
    children,
    freed,
    homing,
    stands_still,
    until,
)
from mock_devices.testing.service import ServedRig
from rig.errors import SafetyStop
from tests.system.presses import SLOW, press

pytestmark = pytest.mark.extra


def asked(port: int, path: str, method: str = "POST") -> tuple[int, dict[str, Any]]:
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    client.request(method, path)
    answer = client.getresponse()
    status, said = answer.status, json.loads(answer.read())
    client.close()
    return status, said


@pytest.fixture
def served(bench: ServedBench, tmp_path: Path) -> Iterator[ServedRig]:
    """The service, with its stop process at a port of its own choice."""
    (tmp_path / "protocols").mkdir()
    (tmp_path / "protocols" / "slow.toml").write_text(SLOW)
    folders = ("--protocols", tmp_path / "protocols", "--sessions", tmp_path / "sessions")
    service = ServedRig(bench, tmp_path, [*folders, *bench.settings("stop.port=0", "loop.lease_s=2")])
    yield service
    os.kill(service.running.process.pid, signal.SIGCONT)


def test_with_the_service_suspended_a_press_is_confirmed_and_the_tip_leaves(
    bench: ServedBench, served: ServedRig
) -> None:
    press(served)
    served.running.process.send_signal(signal.SIGSTOP)
    status, said = asked(served.stop_port, "/pain")
    assert (status, said["confirmed"], said["done"]) == (200, True, "retracting")
    status, again = asked(served.stop_port, "/pain")
    assert (status, again["id"], again["confirmed"]) == (200, said["id"] + 1, True)
    freed(bench)
    assert asked(served.stop_port, "/estop")[1]["done"] == "braked"


FAVOURED = f"setpriority(os.PRIO_PROCESS, 0, {NICE})"


def granted(asked: str) -> bool:
    """Whether this account may go first: tried by a process of its own."""
    trial = f"import os; os.{asked}"
    return not subprocess.run([sys.executable, "-c", trial], stderr=subprocess.DEVNULL, check=False).returncode


def test_a_press_at_the_services_own_address_goes_before_its_clients(served: ServedRig) -> None:
    expected = NICE if granted(FAVOURED) else os.getpriority(os.PRIO_PROCESS, 0)
    assert {os.getpriority(os.PRIO_PROCESS, pid) for pid in threads(served.running.process.pid)} == {expected}
    status, said = asked(served.port, "/api/v1/estop")
    assert (status, said["detail"]) == (200, "braked")


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="on a single core the service does not go first")
def test_what_answers_goes_first_alone_and_what_works_for_it_follows(served: ServedRig) -> None:
    if not (granted(FAVOURED) and granted(f"sched_setscheduler(0, os.SCHED_FIFO, os.sched_param({PRIORITY}))")):
        pytest.skip("real-time priority is not granted here")
    for path in ("/jobs", "/recordings", "/protocols"):
        served.ask("GET", path)
    assert asked(served.port, "/api/v1/estop")[0] == 200  # which is audited, in a thread
    pid = served.running.process.pid
    policies = {thread: os.sched_getscheduler(thread) for thread in threads(pid)}
    assert policies.pop(pid) == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    assert os.sched_getparam(pid).sched_priority == PRIORITY
    assert set(policies.values()) == {os.SCHED_OTHER}
    # The audit's thread begins as the answer leaves.
    until(lambda: {os.getpriority(os.PRIO_PROCESS, each) for each in threads(pid)} == {NICE}, 5.0, "all following")


def threads(pid: int) -> list[int]:
    return [int(each.name) for each in Path(f"/proc/{pid}/task").iterdir()]


def test_with_the_service_killed_a_press_is_confirmed_and_the_process_ends_with_the_loop(
    bench: ServedBench, served: ServedRig
) -> None:
    press(served)
    loop, stop_process = served.loop, served.stop_process
    os.kill(served.running.process.pid, signal.SIGKILL)
    status, said = asked(served.stop_port, "/estop")
    assert (status, said["confirmed"]) == (200, True)
    until(lambda: not _alive(loop) and not _alive(stop_process), PATIENCE_S, "both ended")


def _alive(pid: int) -> bool:
    """Whether it runs; one that nobody has collected does not."""
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP])
def test_with_the_loop_killed_or_frozen_nothing_is_confirmed(served: ServedRig, end: signal.Signals) -> None:
    loop = served.loop
    os.kill(loop, end)
    began = time.monotonic()
    status, said = asked(served.stop_port, "/estop")
    os.kill(loop, signal.SIGCONT) if end is signal.SIGSTOP else None
    assert time.monotonic() - began < 1.5
    assert (status, said["confirmed"]) == (504, False)
    assert said["done"].startswith(NOT_CONFIRMED)


def test_a_stop_while_the_axis_homes_brakes_it_and_ends_the_start(bench: ServedBench) -> None:
    bench.control.set({"surface.position_mm": 60.0})
    settings = [*PATIENT, "stop.port=0", "axis.homing_speed_mm_s=2"]
    supervisor = Supervisor(plug_into(built_in(settings), bench.endpoints))
    supervisor.prepare()
    errors: list[BaseException] = []

    def start() -> None:
        try:
            supervisor.start()
        except SafetyStop as stop:
            errors.append(stop)

    starting = threading.Thread(target=start)
    starting.start()
    homing(bench)
    status, said = asked(supervisor.stop_port, "/estop")
    starting.join(30)
    assert (status, said["done"]) == (200, "braked while the drive moved by itself: nothing starts")
    assert "stopped on request" in str(errors[0])
    stands_still(bench)
    assert bench.control.get("axis.powered")["axis.powered"] is False


def test_a_foot_switch_retracts_and_the_supervisors_own_lane_answers_too(bench: ServedBench, tmp_path: Path) -> None:
    pad = tmp_path / "pad"
    os.mkfifo(pad)
    writer = os.open(pad, os.O_RDWR)
    wiring = plug_into(built_in([*PATIENT, "stop.port=0", f"stop.keypad={pad}"]), bench.endpoints)
    with Supervisor(wiring) as rig:
        os.write(writer, struct.pack("<qqHHi", 0, 0, 1, 48, 1))
        until(lambda: rig.status.get("latched"), PATIENCE_S, "the stop")
        latched = rig.status["latched"]
        assert latched and latched["code"] == "pain_stop"
        rig.reset()
        answer = rig.stops.confirmed(rig.stops.request(StopReason.EMERGENCY), PATIENCE_S)
        assert answer is not None
        assert answer.deed is Deed.BRAKED
    os.close(writer)
    assert rig.stop_port == 0
    assert children(os.getpid(), "controller.stop.server") == []


@pytest.mark.parametrize("key", [b"p", b" ", b"s"])
def test_a_key_pressed_before_the_bench_is_up_keeps_it_from_starting(
    bench: ServedBench, tmp_path: Path, key: bytes
) -> None:
    keyboard, terminal = os.openpty()
    os.write(keyboard, key)
    (tmp_path / "slow.toml").write_text(SLOW)
    running = Running(
        ["capture", tmp_path / "slow.toml", "--out", tmp_path / "session", *bench.settings("stop.port=0")],
        tmp_path,
        stdin=terminal,
    )
    said = running.end()
    os.close(keyboard)
    os.close(terminal)
    assert said.code == 3, said.err
    assert SENTENCE in said.sentence
    assert bench.control.get("axis.powered")["axis.powered"] is False
