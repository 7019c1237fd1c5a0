"""What the supervisor asks of the loop's client, and waits for, one call at a time."""

import threading
from collections.abc import Callable
from typing import Any, cast

import pytest

from controller import supervisor as module
from controller.loop.client import LoopClient
from controller.loop.messages import Recover, Reset, Status
from controller.recovery.situation import Consent
from controller.supervisor import Supervisor
from rig.channel import Message
from rig.config.wiring import Wiring
from rig.results.bench import Question, ResetResult
from tests.controller.played_loop import Surroundings


class AskedClient:
    """In the place of the loop's client: keeps what it is asked and waited for."""

    gone = False

    def __init__(self, status: Status) -> None:
        self.status, self.done = status, list[object]()

    def ask(self, message: Message, what: str, timeout_s: float = 0.0) -> None:
        self.done.append((message, what, timeout_s))

    def wait_until(self, condition: Callable[[Status], bool], timeout_s: float) -> bool:
        self.done.append((condition(self.status), timeout_s))
        return condition(self.status)

    def close(self) -> None:
        """There is nothing to close."""


class AskedEvent(threading.Event):
    """Keeps how long it was waited for, and does not wait."""

    def __init__(self) -> None:
        super().__init__()
        self.waited_s: list[float | None] = []

    def wait(self, timeout: float | None = None) -> bool:
        self.waited_s.append(timeout)
        return self.is_set()


def asking(status: Status) -> tuple[Supervisor, AskedClient, AskedEvent]:
    bench, client, closing = Supervisor(Wiring()), AskedClient(status), AskedEvent()
    bench._client, bench._closing = cast(LoopClient, client), closing
    return bench, client, closing


@pytest.mark.parametrize(("status", "rests"), [({"busy": True}, False), ({"busy": False}, True), ({}, True)])
def test_rest_is_looked_for_once_the_loop_has_had_time_to_say_that_it_moves(status: Status, rests: bool) -> None:
    bench, client, closing = asking(status)
    bench.wait_at_rest(7.0)
    assert closing.waited_s == [0.1]
    assert client.done == [(rests, 7.0)]
    bench.wait_at_rest()
    assert client.done[1] == (rests, 30.0)


def test_a_reset_is_looked_for_once_a_status_from_before_it_is_none_any_more() -> None:
    bench, client, closing = asking({"busy": True})
    bench.reset()
    assert closing.waited_s == [0.1]
    assert client.done == [(Reset(), "a reset", 0.0), (True, 5.0)]


def test_an_act_of_recovery_is_waited_for_until_nothing_moves() -> None:
    bench, client, _ = asking({"busy": False})
    bench.act("retract")
    assert client.done == [(Recover(act="retract"), "retract", 60.0), (True, 60.0)]


@pytest.mark.parametrize(
    ("state", "there"),
    [("ok", True), ("degraded", True), ("fault", True), ("connecting", False), ("lost", False),
     ("reconnecting", False)],
)  # fmt: skip
def test_a_device_is_back_once_it_answers_however(state: str, there: bool) -> None:
    bench, client, _ = asking(
        {"devices": {"axis": {"state": state}, "force": {"state": "ok" if not there else "lost"}}}
    )
    assert bench.await_device("axis", 7.0) is there
    assert client.done == [(there, 7.0)]


@pytest.mark.parametrize("status", [{}, {"devices": {}}, {"devices": {"axis": {}}}])
def test_a_device_of_which_nothing_is_said_is_not_there(status: Status) -> None:
    bench, *_ = asking(status)
    assert bench.await_device("axis", 7.0) is False


@pytest.mark.parametrize(
    ("status", "known"),
    [({"ready": True}, True), ({"latched": {"code": "recovery"}}, True), ({"ready": False, "latched": None}, False)],
)
def test_devices_are_waited_for_until_all_are_ok_or_a_stop_is_in_force(status: Status, known: bool) -> None:
    bench, client, _ = asking(status)
    assert bench.await_ready() is known
    assert client.done == [(known, 3.0)]


def test_the_loop_is_to_come_between_the_stop_process_and_it(around: Surroundings) -> None:
    bench = Supervisor(Wiring())
    to_come = [bench.loop_is_to_come]
    bench.prepare()
    to_come.append(bench.loop_is_to_come)
    with bench:
        to_come.append(bench.loop_is_to_come)
        assert around.processes
    assert to_come == [False, True, False]


@pytest.mark.parametrize(
    ("still_open", "finished"), [((), True), ((Question(act="home", question="home it?"),), False)]
)
def test_a_recovery_to_its_end_settles_what_the_session_before_left(
    around: Surroundings, monkeypatch: pytest.MonkeyPatch, still_open: Any, finished: bool
) -> None:
    found = ResetResult(happened=(), open=still_open)
    monkeypatch.setattr(module, "recover", lambda *_: found)
    assert Supervisor(Wiring()).recover(Consent()) is found, "without a bench there is nothing to settle"
    with Supervisor(Wiring()) as bench:
        assert around.processes and bench._claim
        bench._claim.finished = False
        bench.recover(Consent())
        assert bench._claim.finished is finished
