"""Work that a process of its own is given in the place of a command's: it waits, dies, asks, or talks too much."""

import errno
import os
import shutil
import signal
import sys
import time
from pathlib import Path

from api.http.jobs.params import ExportParams, VerifyParams
from api.http.jobs.worker import Desk
from controller.commissioning.stoppable import stoppable
from controller.operation import Operation
from rig.errors import DataError, SafetyStop
from rig.recording.files import whole_file
from rig.results.recorded import ExportResult, VerifyResult

WHOLE = VerifyResult(ok=True, remarks=(), recordings={})


def patient(operation: Operation, _asked: VerifyParams, _desk: Desk) -> VerifyResult:
    """Looks ten times a second whether it is to end."""
    for turn in range(600):
        operation.step(f"turn {turn}", turn / 600)
        time.sleep(0.1)
    return WHOLE


def deaf(operation: Operation, _asked: VerifyParams, _desk: Desk) -> VerifyResult:
    """Never looks."""
    operation.advance(0.1, "deaf")
    time.sleep(60)
    return WHOLE


def dying(_operation: Operation, _asked: VerifyParams, _desk: Desk) -> VerifyResult:
    """As where the system has no memory left."""
    os.kill(os.getpid(), signal.SIGKILL)
    return WHOLE


def odd(_operation: Operation, _asked: VerifyParams, _desk: Desk) -> VerifyResult:
    """A mistake of ours."""
    raise ZeroDivisionError("the third spring has no length")


def wrong(_operation: Operation, _asked: VerifyParams, _desk: Desk) -> VerifyResult:
    """Something about the data."""
    raise DataError("trial_001: line 3: force is no number")


def removing(_operation: Operation, asked: VerifyParams, desk: Desk) -> VerifyResult:
    """Somebody else takes the session away."""
    folder = desk.places.session(asked.session)
    shutil.rmtree(folder)
    (folder / "session.json").read_bytes()
    return WHOLE


def without_room(_operation: Operation, asked: ExportParams, desk: Desk) -> ExportResult:
    """The disk fills up while a file is written, as a system that is asked to write tells it."""
    with whole_file(desk.places.session(asked.session or "") / "out.bin") as scratch:
        scratch.write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def without_room_unsaid(_operation: Operation, _asked: ExportParams, _desk: Desk) -> ExportResult:
    """The same where nothing of ours stands between."""
    raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT), "/data/session.h5")


def talkative(operation: Operation, _asked: VerifyParams, _desk: Desk) -> VerifyResult:
    """Prints where messages go, and says what belongs into the log."""
    sys.stdout.write("a library says hello\n")
    os.write(1, b"{}\n")
    operation.say("one", "two")
    operation.advance(0.5, "half way")
    operation.say("three")
    return WHOLE


def nice(operation: Operation, _asked: VerifyParams, _desk: Desk) -> VerifyResult:
    """Says at what priority it computes, and how far before others the system ends it where memory runs out."""
    operation.say(f"nice {os.getpriority(os.PRIO_PROCESS, 0)}")
    operation.say(f"ended first: {Path('/proc/self/oom_score_adj').read_text().strip()}")
    return WHOLE


def asking(operation: Operation, _asked: VerifyParams, desk: Desk) -> VerifyResult:
    """Needs a person twice."""
    for load in ("1 N", "2 N"):
        desk.ask(f"put {load} on the tip")
        operation.say(f"{load} is on")
    return WHOLE


def moving(operation: Operation, _asked: VerifyParams, desk: Desk) -> VerifyResult:
    """Moves as a driver does, which brakes where it is told to."""
    with stoppable(desk.wiring, Path(desk.stop_word)) as (guard, _), guard.moving():
        operation.advance(0.1, "moves")
        while not guard.interrupted():
            time.sleep(0.001)
        raise SafetyStop("stopped on request while it was moved")


def moving_deaf(operation: Operation, _asked: VerifyParams, desk: Desk) -> VerifyResult:
    """A computer that is held up in the middle of a move."""
    with stoppable(desk.wiring, Path(desk.stop_word)) as (guard, _), guard.moving():
        operation.advance(0.1, "moves")
        time.sleep(60)
    return WHOLE
