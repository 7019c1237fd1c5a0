"""An operation on the terminal: what it says is printed, Ctrl-C cancels it and stops the bench."""

import functools
import os
import signal
import threading
from typing import cast

import pytest

from api.cli import live
from api.cli.computing import compute
from controller.loop.messages import Status
from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.errors import SafetyStop


class StoppableBench:
    def __init__(self) -> None:
        self.status: Status = {}
        self.stopped = threading.Event()

    def stop(self) -> None:
        self.stopped.set()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_cancels_the_operation_and_stops_the_bench(number: signal.Signals) -> None:
    bench, operation = StoppableBench(), Operation("capture")
    before = signal.getsignal(number)

    def work() -> None:
        os.kill(os.getpid(), number)
        assert bench.stopped.wait(10.0)
        raise SafetyStop("stopped by the operator")

    with pytest.raises(SafetyStop, match="stopped by the operator"):
        live.run(cast(Supervisor, bench), operation, work)
    assert operation.cancelled and operation.progress.state == "stopped"
    assert signal.getsignal(number) is before


def test_what_an_operation_says_is_printed_as_it_stands(capsys: pytest.CaptureFixture[str]) -> None:
    operation = Operation("capture")
    long = "x" * 200

    def work() -> int:
        operation.say("trial_001  [brackets]", long)
        return 5

    assert live.run(cast(Supervisor, StoppableBench()), operation, work) == 5
    assert capsys.readouterr().out == f"trial_001  [brackets]\n{long}\n"


def test_ctrl_c_ends_a_computation_at_once(request: pytest.FixtureRequest) -> None:
    # Whoever starts the tests behind a shell's back has them ignore it.
    request.addfinalizer(functools.partial(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT)))
    signal.signal(signal.SIGINT, signal.default_int_handler)
    operation, after = Operation("fit"), list[str]()

    def work(_: Operation) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        threading.Event().wait(10.0)
        after.append("went on")

    with pytest.raises(KeyboardInterrupt):
        compute(operation, work)
    assert operation.progress.state == "stopped" and not after
