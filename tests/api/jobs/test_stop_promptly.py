"""How long a stop through the service itself may keep the service, and how long it lets others go first."""

import asyncio
from collections.abc import Callable
from typing import Any, cast

import pytest

from api.http.service import Service
from controller.stop.word import Deed, StopOutcome, StopReason, StopRequest
from controller.supervisor import Supervisor

BRAKED = StopOutcome(1, Deed.BRAKED, 0)
# What 50 streams at 30 messages a second, and 200 requests, may wait for once.
LONGEST_S = 0.005


class AnsweredAfter:
    """The asking end of a loop that answers the ``waited``-th time that somebody waits for it, or looks."""

    def __init__(self, waited: int) -> None:
        self._left = waited
        self.kept_s = 0.0

    def request(self, kind: StopReason) -> StopRequest:
        return StopRequest(1, kind)

    def confirmed(self, request: StopRequest, within_s: float) -> StopOutcome | None:
        self.kept_s += within_s
        return self.answer(request)

    def answer(self, request: StopRequest) -> StopOutcome | None:
        self._left -= 1
        return BRAKED if self._left <= 0 else None


@pytest.fixture
def stopping(service: Service, monkeypatch: pytest.MonkeyPatch) -> Callable[[AnsweredAfter], Any]:
    """Begins a stop at a bench with these ``stops``; what the service waits for is sent to it by the test."""

    def begin(stops: AnsweredAfter) -> Any:
        bench = cast(Supervisor, type("Coming", (), {"stops": stops})())
        monkeypatch.setattr(service, "stoppable", lambda: bench)
        return service.stop(StopReason.EMERGENCY)

    return begin


def test_a_stop_that_the_loop_confirms_at_once_waits_for_no_other_work_of_the_service(
    stopping: Callable[[AnsweredAfter], Any],
) -> None:
    stops = AnsweredAfter(1)
    with pytest.raises(StopIteration) as ended:
        stopping(stops).send(None)
    assert ended.value.value == BRAKED
    assert 0.0 < stops.kept_s <= LONGEST_S


def test_a_loop_that_takes_longer_keeps_the_service_only_once(stopping: Callable[[AnsweredAfter], Any]) -> None:
    stops = AnsweredAfter(5)
    assert asyncio.run(stopping(stops)) == BRAKED
    assert stops.kept_s <= LONGEST_S
