"""Followers of the feed take their turns one part after another: what is asked meanwhile waits for one part only."""

import asyncio
import itertools
import time

import pytest

from api.http.streams.events import EventLog
from api.http.streams.feed import PERIOD_S, Feed
from rig.config.wiring import Wiring

FOLLOWERS = 50
PERIODS = 4


async def followed() -> tuple[list[int], int]:
    """How often each follower was woken in some periods, and the most that were within one turn of the event loop."""
    feed = Feed(Wiring(), lambda: None, EventLog())
    woken, most, within = [0] * FOLLOWERS, 0, 0

    async def follow(number: int) -> None:
        nonlocal within
        turn = feed.follower()
        while True:
            await turn()
            woken[number] += 1
            within += 1

    tasks = [asyncio.create_task(part) for part in (feed.follow(), *map(follow, range(FOLLOWERS)))]
    ends_s = asyncio.get_running_loop().time() + PERIODS * PERIOD_S
    while asyncio.get_running_loop().time() < ends_s:
        within = 0
        await asyncio.sleep(0)
        most = max(most, within)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return woken, most


def test_fifty_followers_are_woken_in_parts_and_each_once_a_period() -> None:
    woken, most = asyncio.run(followed())
    assert 1 <= most <= 5, "a stop that comes now waits for so many"
    assert min(woken) >= 1
    assert max(woken) - min(woken) <= 1, "all of them equally often"


def test_a_follower_that_was_woken_waits_for_the_next_period() -> None:
    async def turns() -> list[float]:
        feed = Feed(Wiring(), lambda: None, EventLog())
        task, turn, times_s = asyncio.create_task(feed.follow()), feed.follower(), []
        for _ in range(3):
            await turn()
            times_s.append(asyncio.get_running_loop().time())
        task.cancel()
        return times_s

    assert all(after - before > PERIOD_S / 2 for before, after in itertools.pairwise(asyncio.run(turns())))


def test_while_the_event_loop_is_late_followers_come_up_to_five_periods_later(monkeypatch: pytest.MonkeyPatch) -> None:
    """And as often as ever after three periods in time for each step back: here 10 of 10 parts, 2 of them, 10."""
    monkeypatch.setattr("api.http.streams.feed.CALM_PERIODS", 3)

    async def counted() -> tuple[int, int]:
        feed, woken = Feed(Wiring(), lambda: None, EventLog()), 0

        async def follow() -> None:
            nonlocal woken
            turn = feed.follower()
            while True:
                await turn()
                woken += 1

        tasks = [asyncio.create_task(part) for part in (feed.follow(), follow())]
        for _ in range(25):
            await asyncio.sleep(PERIOD_S / 4)
            time.sleep(PERIOD_S)
        late = woken
        await asyncio.sleep(10 * PERIOD_S)
        before = woken
        await asyncio.sleep(20 * PERIOD_S)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        return late, woken - before

    late, calm = asyncio.run(counted())
    assert 3 <= late <= 12, "of 31 periods"
    assert calm >= 15, "of 20 periods"
