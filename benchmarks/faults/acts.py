"""How faults are brought about: on the bench, on our own processes, by the operator."""

import os
import resource
import signal
import threading
import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from http.client import HTTPConnection

from benchmarks.faults.fault import Act, Live
from controller.loop.steps import Hold, Program
from drivers.evdev.codec import DOWN, EV_KEY, EVENT
from mock_devices.faults.wires import Value
from rig.config.stop import KEY_CODES

LOOP, RECORDER = "loop_process", "rig.recording.recorder"
# Longer than anything may go on without the frozen process, and short enough for the bench to be asked afterwards.
FROZEN_S = 4.5
# Any file is larger already: what is written next fails.
FILE_BYTES = 1
# More points than one message may carry: 4,000 of them made the loop's process raise.
POINTS = 400_000


def nothing(_: Live) -> None:
    """The configuration is the fault."""


def device(role: str, kind: str, value: Value | None = None) -> Act:
    """A fault of one device, as `rig mock` offers it."""
    return lambda live: live.bench.control.fault(role, kind, value)


def several(*acts: Act) -> Act:
    """One after the other."""

    def act(live: Live) -> None:
        for each in acts:
            each(live)

    return act


def once_out(act: Act) -> Act:
    """``act`` as soon as the tip has left the tissue."""

    def later(live: Live) -> None:
        while live.bench.control.number("tip.depth_mm") > -1.0:
            time.sleep(0.005)
        act(live)

    return later


def set_quantities(**values: Value) -> Act:
    """Sets quantities of the bench; ``tissue__present`` stands for ``tissue.present``."""
    wanted = {name.replace("__", "."): value for name, value in values.items()}

    def act(live: Live) -> None:
        live.bench.control.set(wanted)

    return act


def slipping_scale(live: Live) -> None:
    """The tip's way over that of the axis is 1 + 2 pi / 50 where the axis sets out, unknown to any calibration."""
    live.bench.control.hide({"position_ripple.amplitude_mm": 1.0, "position_ripple.period_mm": 50.0})


def killed(pid_of: Callable[[Live], int]) -> Act:
    """SIGKILL."""
    return lambda live: os.kill(pid_of(live), signal.SIGKILL)


def frozen(pid_of: Callable[[Live], int], seconds: float = FROZEN_S) -> Act:
    """SIGSTOP, and SIGCONT after ``seconds``."""

    def act(live: Live) -> None:
        pid = pid_of(live)
        os.kill(pid, signal.SIGSTOP)
        threading.Timer(seconds, partial(_continue, pid)).start()

    return act


def stuttering(pid_of: Callable[[Live], int], times: int, seconds: float) -> Act:
    """Stopped for ``seconds``, then running as long, again and again."""

    def act(live: Live) -> None:
        pid = pid_of(live)
        for _ in range(times):
            suspend(pid, seconds)
            time.sleep(seconds)

    return act


def suspend(pid: int, seconds: float) -> None:
    """Stopped for ``seconds``."""
    os.kill(pid, signal.SIGSTOP)
    time.sleep(seconds)
    _continue(pid)


def _continue(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGCONT)
    except ProcessLookupError:
        return


def loop(live: Live) -> int:
    """The loop's process."""
    return live.rig.loop_pid if live.rig else live.child("loop")


def recorder(live: Live) -> int:
    """The recorder's process."""
    return live.child(RECORDER)


def operator(live: Live) -> int:
    """The program that runs the bench, which is another process than this one."""
    assert live.other, "only a program of its own can be frozen or killed"
    return live.pid


def bench(live: Live) -> int:
    """The process that plays all devices."""
    return int(live.bench.endpoints.pid)


def full_disk(live: Live) -> None:
    """The recorder may write no more."""
    resource.prlimit(recorder(live), resource.RLIMIT_FSIZE, (FILE_BYTES, FILE_BYTES))


def stop_process(live: Live) -> int:
    """The process of the stop port and the foot switch."""
    return live.child("controller.stop.server")


def inputs_process(live: Live) -> int:
    """The process of the inputs."""
    return live.child("controller.inputs.process")


def at_stop_port(path: str) -> Act:
    """A request to the stop process, as page and REST send it."""

    def act(live: Live) -> None:
        connection = HTTPConnection("127.0.0.1", live.supervisor.stop_port, timeout=5.0)
        with closing(connection):
            connection.request("POST", path)
            connection.getresponse().read()

    return act


def foot_switch(key: str) -> Act:
    """Its key goes down; the device is a FIFO."""

    def act(live: Live) -> None:
        with live.keypad.open("wb") as device:
            device.write(EVENT.pack(0, 0, EV_KEY, KEY_CODES[key], DOWN))

    return act


def unattended(live: Live) -> None:
    """Whoever runs the bench is there no more."""
    live.supervisor.attended = lambda: False


def oversized_message(live: Live) -> None:
    """A program too large for a message."""
    live.supervisor.run(Program(name="x" * POINTS, steps=(Hold(duration_s=0.0),)), 5.0)
