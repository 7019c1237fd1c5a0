"""Stops of whoever moves the axis without a loop, at a stop word of its own or of somebody else."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from controller.commissioning.stoppable import stop_for_lost, stoppable
from controller.stop.word import Deed, Lane, Requester, StopReason, StopWord
from rig.config.wiring import Wiring
from rig.errors import DeviceError, SafetyStop


@pytest.fixture
def page(tmp_path: Path) -> Iterator[StopWord]:
    page = StopWord.create(tmp_path / "a.stop")
    yield page
    page.close(unlink=True)


@pytest.mark.parametrize("lane", Lane)
def test_at_a_word_that_is_there_stops_of_every_lane_count_and_no_process_is_started(
    page: StopWord, lane: Lane
) -> None:
    asking = Requester(page, lane)
    with stoppable(Wiring(), page.path) as (guard, port):
        answer = asking.confirmed(asking.request(StopReason.PAIN), 0.5)
        with pytest.raises(SafetyStop):
            guard.refuse()
    assert port == 0 and page.server_pid == 0
    assert answer is not None and answer.deed is Deed.START_ENDED


def test_who_started_it_is_gone_and_the_axis_is_stopped_in_its_place(page: StopWord) -> None:
    with stoppable(Wiring(), page.path) as (guard, _):
        guard.refuse()
        stop_for_lost(page.path)
        with pytest.raises(SafetyStop), guard.moving():
            while not guard.interrupted():
                pass
            guard.refuse()


def test_without_the_word_nothing_begins(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="no stop word"), stoppable(Wiring(), tmp_path / "none.stop"):
        pass
