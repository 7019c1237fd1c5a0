"""An operation on the terminal: what it says is printed, Ctrl-C cancels it and stops the bench."""

import functools
import os
import signal
import sys
import threading
from typing import cast

import pytest

from api.cli import endings, live
from api.cli.computing import compute
from controller.loop.messages import Status
from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.config.wiring import Wiring
from rig.errors import SafetyStop


class StoppableBench:
    def __init__(self) -> None:
        self.status: Status = {}
        self.stopped = threading.Event()

    def stop(self) -> None:
        self.stopped.set()


@pytest.fixture
def left(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """When the terminal was left; the tests go on writing to theirs."""
    found: list[str] = []
    monkeypatch.setattr(endings, "_leave_terminal", lambda: found.append("left"))
    return found


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_cancels_the_operation_and_stops_the_bench(number: signal.Signals, left: list[str]) -> None:
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
    assert left == (["left"] if number is signal.SIGHUP else [])


class SignalledBench:
    """Its start, and its end, are met by the signals that are sent there."""

    def __init__(self, starting: list[int], ending: list[int]) -> None:
        self.starting, self.ending = starting, ending
        self.done: list[str] = []

    def prepare(self) -> None:
        self.done.append("prepared")

    def start(self) -> None:
        try:
            self._meet(self.starting)
        except BaseException:
            self.close()
            raise
        self.done.append("started")

    def refuse_held(self) -> None:
        self.done.append("used")

    def close(self) -> None:
        self._meet(self.ending)
        self.done.append("closed")

    def _meet(self, numbers: list[int]) -> None:
        for number in numbers:
            os.kill(os.getpid(), number)


def connected(bench: SignalledBench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Starts the bench and ends it; signals are as before then."""
    before = [signal.getsignal(number) for number in endings.ENDINGS]
    monkeypatch.setattr(live, "Supervisor", lambda _: bench)
    try:
        with live.connected(Wiring()):
            pass
    finally:
        assert [signal.getsignal(number) for number in endings.ENDINGS] == before


@pytest.mark.parametrize("number", endings.ENDINGS)
def test_a_start_is_ended_in_order_and_the_end_itself_is_let_end(
    number: signal.Signals, left: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # A shell and the kernel both say that a terminal was closed.
    bench = SignalledBench(starting=[number], ending=[number, *endings.ENDINGS])
    with pytest.raises(KeyboardInterrupt):
        connected(bench, monkeypatch)
    assert bench.done == ["prepared", "closed", "closed"]
    assert left


def test_an_end_that_is_met_by_a_signal_is_no_failure(left: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    bench = SignalledBench(starting=[], ending=[*endings.ENDINGS])
    connected(bench, monkeypatch)
    assert (bench.done, left) == (["prepared", "started", "used", "closed"], ["left"])


def test_a_terminal_that_was_closed_is_written_to_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    keyboard, terminal = os.openpty()
    with os.fdopen(terminal, "w", buffering=1) as stream, monkeypatch.context() as patch:
        for name in ("stdin", "stdout", "stderr"):
            patch.setattr(sys, name, stream)
        os.close(keyboard)
        with pytest.raises(OSError, match="Input/output error"):
            stream.write("nobody reads\n")
        endings._leave_terminal()
        stream.write("nobody reads\n")


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
