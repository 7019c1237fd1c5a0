"""The stop process as a whole, in this one: how long it serves, and what it reads of its command line."""

import json
import os
import signal
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from controller.loop import realtime
from controller.stop import server as module
from controller.stop.keypad import Keys, open_device
from controller.stop.server import StopServer
from controller.stop.word import Keypad, StopReason, StopWord


class Turns:
    """In the place of the server: ends once ``overs`` says so."""

    def __init__(self, parent: int, overs: list[bool], before_turn: Callable[[int], None]) -> None:
        self.parent, self.overs, self.before_turn = parent, overs, before_turn
        self.turns, self.watched = 0, dict[int, Callable[[], None]]()
        self.unwatched: list[int] = []
        self.loop = SimpleNamespace(over=lambda: self.overs.pop(0) if len(self.overs) > 1 else self.overs[0])

    def watch(self, fd: int, ready: Callable[[], None]) -> None:
        self.watched[fd] = ready

    def unwatch(self, fd: int) -> None:
        self.unwatched.append(fd)

    def turn(self) -> None:
        self.turns += 1
        self.before_turn(self.turns)
        assert self.turns < 20, "it does not end"


def test_it_serves_until_supervisor_and_loop_have_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = StopWord.create(tmp_path / "a.stop")
    reading, writing = os.pipe()
    beats: list[int] = []
    ticks = iter(range(1000, 9999))
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic_ns=lambda: next(ticks), monotonic=time.monotonic))

    def on(turn: int) -> None:
        beats.append(page.words[5])
        if turn == 2:
            os.write(writing, b"x")  # a sign of life is no end
            server.watched[reading]()
        if turn == 4:
            os.close(writing)
            for _ in range(2):
                server.watched[reading]()

    # The loop lives for two more looks after the supervisor has gone.
    server = Turns(reading, [False, False, True], on)
    module.serve(cast(StopServer, server), reading, page)
    assert server.turns == 6
    assert server.unwatched == [reading]
    assert page.server_pid == os.getpid()
    assert beats == [1001, 1002, 1003, 1004, 1005, 1006], "a beat before the first turn and one for each"
    os.close(reading)
    page.close(unlink=True)


def test_the_process_reads_its_settings_and_gives_everything_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.stop"
    StopWord.create(path).close()
    listener = socket.create_server(("127.0.0.1", 0))
    signals: dict[int, Any] = {}
    done: list[Any] = []
    monkeypatch.setattr(signal, "signal", signals.__setitem__)
    monkeypatch.setattr(realtime, "raise_priority", done.append)
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(fileno=lambda: 77))

    def serve(server: StopServer, parent: int, page: StopWord) -> None:
        keyboard = server._keyboard
        assert keyboard._pad
        handed = (keyboard._path, keyboard._pad.fd)
        done.extend([parent, page.path, server._listener.fileno(), handed, keyboard._keys, keyboard._required])
        done.extend([page.keypad, server.state()["keypad"]])

    monkeypatch.setattr(module, "serve", serve)
    pad = tmp_path / "pad"
    os.mkfifo(pad)
    writer, keypad = os.open(pad, os.O_RDWR), open_device(str(pad))
    settings = {
        "keypad": str(pad), "keypad_required": True, "keys": {"48": "PAIN"}, "other_keys": "STOP", "priority": 39
    }  # fmt: skip
    arguments = [str(path), str(listener.detach()), str(keypad), json.dumps(settings)]
    assert module.main(arguments) == 0
    fd = int(arguments[1])
    keys = Keys({48: StopReason.PAIN}, StopReason.STOP)
    assert done == [39, 77, path, fd, (str(pad), keypad), keys, True, Keypad.OK, "ok"]
    os.close(writer)
    os.close(keypad)
    assert {number: signals[number] for number in (signal.SIGINT, signal.SIGHUP)} == {
        signal.SIGINT: signal.SIG_IGN, signal.SIGHUP: signal.SIG_IGN
    }  # fmt: skip
    with pytest.raises(SystemExit) as ended:
        signals[signal.SIGTERM](signal.SIGTERM, None)
    assert ended.value.code == 0
    assert not path.exists()
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(fd)
