"""The supervisor's side of the stop process: starts it, tells its port, and asks through a lane of its own."""

import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

from controller.stop.keypad import open_device
from controller.stop.word import Lane, Requester, StopReason, StopWord
from rig.config.stop import Stop
from rig.config.wiring import Wiring
from rig.errors import DeviceError

START_S = 10.0
END_S = 2.0
HOST = "127.0.0.1"


class StopProcess:
    """The process and its page at ``path``; raises DeviceError where it does not start or the keypad is not there."""

    def __init__(self, wiring: Wiring, path: Path) -> None:
        settings = wiring.stop
        keypad = open_device(settings.keypad) if settings.keypad else -1
        self.path = path
        try:
            self._page = StopWord.create(path)
            with _listening(settings.port) as listener:
                self.port: int = listener.getsockname()[1]
                self._process = _started(path, listener.fileno(), keypad, _settings(settings, wiring.loop.priority))
        finally:
            if keypad >= 0:
                os.close(keypad)
        self.requester = Requester(self._page, Lane.SUPERVISOR)
        self._await()

    @property
    def pid(self) -> int:
        """Its process number."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process.poll() is None

    def close(self) -> None:
        """Ends it."""
        self._process.terminate()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdin:
            self._process.stdin.close()
        self._page.close(unlink=True)

    def _await(self) -> None:
        deadline = time.monotonic() + START_S
        while not self._page.server_pid:
            if not self.alive or time.monotonic() > deadline:
                self.close()
                raise DeviceError(f"the stop process did not start within {START_S:g} s; nothing moves without it")
            time.sleep(0.002)


def _settings(stop: Stop, loop_priority: int) -> str:
    names = {"stop": StopReason.STOP.name, "pain": StopReason.PAIN.name, "emergency": StopReason.EMERGENCY.name}
    return json.dumps(
        {
            "keypad": stop.keypad,
            "keypad_required": stop.keypad_required,
            "keys": {code: names[kind] for code, kind in stop.key_codes.items()},
            "other_keys": names[stop.other_keys],
            # Below the loop, which has to take what this process writes.
            "priority": max(loop_priority - 1, 0),
        }
    )


def _started(path: Path, listener: int, keypad: int, settings: str) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        [sys.executable, "-m", "controller.stop.server", str(path), str(listener), str(keypad), settings],
        pass_fds=[listener, *([keypad] if keypad >= 0 else [])],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )


def _listening(port: int) -> socket.socket:
    try:
        return socket.create_server((HOST, port))
    except OSError:
        return socket.create_server((HOST, 0))
