"""Around a supervisor: a played loop at the other end of a real channel, and processes that are not there."""

import os
import signal
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from socket import socket
from typing import Any

from controller.loop.messages import (
    TO_LOOP,
    DeviceFound,
    Finished,
    Outcome,
    Ready,
    Reset,
    Run,
    Shutdown,
    Status,
    StatusSaid,
)
from controller.loop.steps import Program, Zero
from controller.stop.word import StopReason
from rig.channel import Answer, Channel, Message, Received
from rig.config.wiring import Wiring

PROGRAM = Program(name="zero", steps=(Zero(duration_s=0.1),))
OUTCOME = Outcome("complete", "", 1.0, None, None)
DEVICES = {"force": DeviceFound(product="p")}


class PlayedLoop(threading.Thread):
    """The loop's end of the channel: answers what it is asked, and keeps it."""

    def __init__(self, end: socket, around: "Surroundings") -> None:
        super().__init__(daemon=True)
        self.channel, self.around = Channel(end, TO_LOOP), around
        self.heard: list[Message] = []
        self.ended = threading.Event()

    def run(self) -> None:
        self.say(self.around.first)
        self.say(StatusSaid(status=self.around.status))
        while not self.ended.wait(0.001) and not self.channel.lost:
            received = self.channel.receive()
            if received:
                self.heard.append(received.message)
                self.around.reply(self, received)
        self.channel.close()

    def say(self, message: Message) -> None:
        self.channel.send(message)

    def of(self, kind: type[Message]) -> list[Any]:
        return [message for message in self.heard if isinstance(message, kind)]


@dataclass
class FakeProcess:
    """What stands for the loop's process: ends with its played loop, or hangs until it is killed."""

    command: list[str]
    options: dict[str, Any]
    loop: PlayedLoop
    around: "Surroundings"
    pid: int = 4711
    code: int | None = None
    waits: list[float | None] = field(default_factory=list)
    killed: bool = False

    def poll(self) -> int | None:
        return self.code

    def wait(self, timeout: float | None = None) -> int:
        self.waits.append(timeout)
        if self.around.hangs and not self.killed:
            raise subprocess.TimeoutExpired("loop", timeout or 0.0)
        self.loop.join(5)
        self.code = self.around.exit_code if self.code is None else self.code
        return self.code

    def kill(self) -> None:
        self.killed = True
        self.code = -signal.SIGKILL
        self.loop.ended.set()


@dataclass
class FakeStops:
    """The stop process: keeps what was asked of the word."""

    wiring: Wiring
    path: Path
    port: int = 5151
    asked: list[StopReason] = field(default_factory=list)
    closed: int = 0

    @property
    def requester(self) -> "FakeStops":
        return self

    def request(self, kind: StopReason) -> None:
        self.asked.append(kind)

    def close(self) -> None:
        self.closed += 1


class FakeRecorder:
    """The recorder's client: only its end matters here."""

    def __init__(self, ring: Path) -> None:
        self.ring, self.quits = ring, 0

    def quit(self) -> None:
        self.quits += 1


def obedient(loop: PlayedLoop, received: Received) -> None:
    match received.message:
        case Run():
            loop.say(Answer(to=received.id))
            loop.say(Finished(program=received.id, outcome=OUTCOME))
        case Shutdown():
            loop.ended.set()
        case Reset():
            loop.say(Answer(to=received.id))
            loop.say(StatusSaid(status={**loop.around.status, "latched": None}))


@dataclass
class Surroundings:
    """What the supervisor finds around it."""

    first: Message = field(default_factory=lambda: Ready(devices=DEVICES, realtime={"core": "1"}))
    status: Status = field(default_factory=lambda: Status(ready=True, busy=False, latched=None))
    reply: Callable[[PlayedLoop, Received], None] = field(default=obedient)
    exit_code: int = 0
    hangs: bool = False
    processes: list[FakeProcess] = field(default_factory=list)
    stops: list[FakeStops] = field(default_factory=list)

    @property
    def process(self) -> FakeProcess:
        return self.processes[-1]

    @property
    def loop(self) -> PlayedLoop:
        return self.process.loop

    def popen(self, command: list[str], **options: Any) -> FakeProcess:
        loop = PlayedLoop(socket(fileno=os.dup(int(command[5]))), self)
        self.processes.append(FakeProcess(command, options, loop, self))
        loop.start()
        return self.process

    def stop_process(self, wiring: Wiring, path: Path) -> FakeStops:
        self.stops.append(FakeStops(wiring, path))
        return self.stops[-1]


def until(condition: Callable[[], bool], within_s: float = 3.0) -> None:
    waits = threading.Event()
    for _ in range(round(within_s / 0.005)):
        if condition():
            return
        waits.wait(0.005)
    raise AssertionError("it did not come")
