"""The bench as of now, twenty times a second, to any number of readers: looked at once, sent to all.

A reader that is slower than that gets the newest view when it is ready for one; none of them holds up another.
"""

import asyncio
from collections.abc import AsyncIterator, Callable

PERIOD_S = 0.05


class Broadcast:
    """Calls ``look`` in a thread, every 50 ms while there are readers, and hands its text to all of them."""

    def __init__(self, look: Callable[[], str], period_s: float = PERIOD_S) -> None:
        self._look, self._period_s = look, period_s
        self._readers = 0
        self._newest = ""
        self._fresh = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    async def stream(self) -> AsyncIterator[str]:
        """Server-sent events, for as long as the reader stays."""
        self._readers += 1
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._run())
        try:
            while True:
                fresh = self._fresh
                await fresh.wait()
                yield self._newest
        finally:
            self._readers -= 1

    async def _run(self) -> None:
        while self._readers:
            self._newest = f"data: {await asyncio.to_thread(self._look)}\n\n"
            fresh, self._fresh = self._fresh, asyncio.Event()
            fresh.set()
            await asyncio.sleep(self._period_s)
