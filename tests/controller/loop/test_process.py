"""The loop's own process is told to end by a signal: what homes is braked, what runs retracts, and it leaves."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from controller.devices.drivers import Interrupted
from controller.loop import process, realtime
from controller.loop.bench_loop import BenchLoop
from controller.loop.commands import Inbox
from controller.loop.messages import FROM_LOOP, LoopFailed
from controller.stop.word import StopWord
from rig.channel import Channel, Message, pair
from rig.config.wiring import Wiring
from rig.errors import SafetyStop

ENDINGS = (signal.SIGTERM, signal.SIGHUP)
AT_REST = cast(BenchLoop, SimpleNamespace(machine=SimpleNamespace(busy=False)))


@pytest.fixture(autouse=True)
def signals_kept() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, *ENDINGS)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


class Bench:
    """Devices and the loop after them, each of which a signal may meet; ``met`` names what it is to meet."""

    fault = ""

    def __init__(self, number: signal.Signals, met: str) -> None:
        self._number, self._met = number, met
        self._interrupted: Interrupted = lambda: False
        self.axis, self.done = self, list[str]()
        self.leaves: bool | None = None

    def start(self, _: Wiring, interrupted: Interrupted) -> "Bench":
        self._interrupted = interrupted
        self._meet("start")
        return self

    def home(self) -> None:
        self._meet("home")
        if self._interrupted():
            raise SafetyStop("the axis was braked")

    def enable(self) -> None:
        self._meet("enable")

    def close(self) -> None:
        self.done.append("close")

    def run(self, inbox: Inbox) -> None:
        self._meet("run")
        self.leaves = not inbox.more(AT_REST)

    def _meet(self, where: str) -> None:
        self.done.append(where)
        if where == self._met:
            os.kill(os.getpid(), self._number)


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The process' own code with a bench in the place of devices and loop: its exit code, and what it said."""

    def serve(bench: Bench) -> tuple[int, list[Message]]:
        monkeypatch.setattr(process, "start_devices", bench.start)
        monkeypatch.setattr(process, "_run", lambda *arguments: bench.run(arguments[4]))
        monkeypatch.setattr(process, "warm_up", lambda _: None)
        monkeypatch.setattr(realtime, "acquire", lambda _: {})
        mine, theirs = pair()
        page = tmp_path / "a.stop"
        StopWord.create(page).close()
        code = process.main([Wiring().model_dump_json(), str(tmp_path / "a.ring"), str(theirs.detach()), str(page)])
        channel = Channel(mine, FROM_LOOP)
        said = [received.message for received in channel.receive_all()]
        channel.close()
        return code, said

    return serve


@pytest.mark.parametrize("number", ENDINGS)
@pytest.mark.parametrize("met", ["start", "home"])
def test_a_signal_before_or_while_the_axis_homes_has_the_driver_brake_it(
    served: Any, number: signal.Signals, met: str
) -> None:
    bench = Bench(number, met)
    assert served(bench) == (1, [LoopFailed(text="the axis was braked", stopped=True)])
    assert bench.done == ["start", "home", "close"]


@pytest.mark.parametrize("number", ENDINGS)
@pytest.mark.parametrize(("met", "leaves"), [("enable", True), ("run", True), ("nothing", False)])
def test_a_signal_once_it_has_homed_has_it_leave_in_order(
    served: Any, number: signal.Signals, met: str, leaves: bool
) -> None:
    bench = Bench(number, met)
    assert served(bench) == (0, [])
    assert bench.done == ["start", "home", "enable", "run", "close"]
    assert bench.leaves is leaves
