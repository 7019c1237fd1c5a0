"""The supervisor's side of the stop process, with a process that is not there."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from controller.stop import client as module
from controller.stop.client import StopProcess
from controller.stop.word import Lane, Requester, Responder, StopReason, StopWord
from rig.config.stop import Stop
from rig.config.wiring import Wiring
from rig.errors import DeviceError
from tests.controller.descriptors import open_files


class FakePipe:
    """Standard input of the process."""

    closed = False

    def close(self) -> None:
        self.closed = True


class Processes:
    """In the place of ``subprocess.Popen``: what was started, and how it behaves."""

    def __init__(self) -> None:
        self.serves, self.hangs = True, False
        self.code: int | None = None
        self.command: list[str] = []
        self.options: dict[str, Any] = {}
        self.listened = ("", 0)
        self.keypads: list[bool] = []
        self.calls: list[Any] = []
        self.pid, self.stdin = 99, FakePipe()

    def __call__(self, command: list[str], **options: Any) -> "Processes":
        self.command, self.options = command, options
        with socket.socket(fileno=os.dup(int(command[4]))) as listener:
            self.listened = listener.getsockname()
        if self.serves:
            page = StopWord.open(Path(command[3]))
            page.serve(self.pid)
            page.close()
        return self

    def poll(self) -> int | None:
        return self.code

    def terminate(self) -> None:
        self.calls.append("terminate")

    def kill(self) -> None:
        self.calls.append("kill")

    def wait(self, timeout: float | None = None) -> int:
        self.calls.append(timeout)
        if self.hangs and timeout is not None:
            raise subprocess.TimeoutExpired("stop", timeout)
        return 0


@pytest.fixture
def processes(monkeypatch: pytest.MonkeyPatch) -> Processes:
    made = Processes()
    monkeypatch.setattr(subprocess, "Popen", made)
    return made


def wired(**stop: Any) -> Wiring:
    return Wiring.model_validate({"stop": {"port": 0, **stop}})


def test_the_process_gets_its_page_its_port_and_its_settings(processes: Processes, tmp_path: Path) -> None:
    path, wiring, before = tmp_path / "a.stop", wired(), open_files()
    process = StopProcess(wiring, path)
    listener = processes.command[4]
    assert processes.command == [
        sys.executable, "-m", "controller.stop.server", str(path), listener, "-1",
        module._settings(wiring.stop, wiring.loop.priority),
    ]  # fmt: skip
    assert processes.options == {
        "pass_fds": [int(listener)], "stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "start_new_session": True
    }  # fmt: skip
    assert processes.listened == ("127.0.0.1", process.port)
    assert (process.path, process.pid, process.alive) == (path, 99, True)
    request = process.requester.request(StopReason.PAIN)
    page = StopWord.open(path)
    assert Responder(page).take(1) == (request,)
    assert Requester(page, Lane.SUPERVISOR).request(StopReason.PAIN).id == request.id + 1, "the supervisor's own lane"
    page.close()
    process.close()
    assert processes.calls == ["terminate", 2.0]
    assert processes.stdin.closed
    assert not path.exists()
    assert open_files() <= before


def test_a_process_that_has_ended_is_not_alive_and_one_that_hangs_is_killed(
    processes: Processes, tmp_path: Path
) -> None:
    process = StopProcess(wired(), tmp_path / "a.stop")
    processes.code, processes.hangs = 1, True
    assert not process.alive
    process.close()
    assert processes.calls == ["terminate", 2.0, "kill", None]


def test_a_keypad_is_opened_here_handed_over_and_closed_here(processes: Processes, tmp_path: Path) -> None:
    pad, before = tmp_path / "pad", open_files()
    os.mkfifo(pad)
    writer = os.open(pad, os.O_RDWR)
    process = StopProcess(wired(keypad=str(pad)), tmp_path / "a.stop")
    listener, keypad = map(int, processes.command[4:6])
    assert keypad > 2
    assert processes.options["pass_fds"] == [listener, keypad]
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(keypad)
    process.close()
    os.close(writer)
    assert open_files() <= before


@pytest.mark.parametrize(("keypad", "passed"), [(-1, [7]), (0, [7, 0]), (5, [7, 5])])
def test_a_keypad_that_is_there_is_passed_on(monkeypatch: pytest.MonkeyPatch, keypad: int, passed: list[int]) -> None:
    seen: list[dict[str, Any]] = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **options: seen.append({"command": command, **options}))
    module._started(Path("/p"), 7, keypad, "{}")
    assert seen[0]["pass_fds"] == passed
    assert seen[0]["command"][3:] == ["/p", "7", str(keypad), "{}"]


def test_a_process_that_ends_before_it_serves_is_an_error_and_leaves_nothing(
    processes: Processes, tmp_path: Path
) -> None:
    processes.serves, processes.code = False, 1
    with pytest.raises(DeviceError, match="did not start within 10 s; nothing moves without it"):
        StopProcess(wired(), tmp_path / "a.stop")
    assert processes.calls == ["terminate", 2.0]
    assert list(tmp_path.iterdir()) == []


def test_a_process_that_never_serves_is_waited_for_ten_seconds(
    processes: Processes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    processes.serves = False
    now, slept = [100.0], list[float]()

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        now[0] += 2.5

    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))
    with pytest.raises(DeviceError, match="did not start within 10 s"):
        StopProcess(wired(), tmp_path / "a.stop")
    # At 110 s the time is not over yet.
    assert slept == [0.002] * 5


def test_the_settings_name_kinds_as_the_stop_word_does() -> None:
    stop = Stop(keypad="/dev/pad", keypad_required=True, keys={"p": "pain", "s": "stop", "300": "emergency"},
                other_keys="pain")  # fmt: skip
    assert json.loads(module._settings(stop, 40)) == {
        "keypad": "/dev/pad", "keypad_required": True, "keys": {"25": "PAIN", "31": "STOP", "300": "EMERGENCY"},
        "other_keys": "PAIN", "priority": 39,
    }  # fmt: skip
    assert json.loads(module._settings(stop, 0))["priority"] == 0


def test_a_port_that_is_taken_is_replaced_by_a_free_one() -> None:
    with module._listening(0) as first:
        taken = first.getsockname()[1]
        with module._listening(taken) as second:
            assert second.getsockname()[0] == "127.0.0.1"
            assert second.getsockname()[1] != taken
            assert second.getsockname()[1] > 1023, "any user may listen there"


def test_limits_of_waiting() -> None:
    assert (module.START_S, module.END_S, module.HOST) == (10.0, 2.0, "127.0.0.1")
