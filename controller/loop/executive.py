"""The cyclic executive's clock: an absolute grid on the monotonic clock; a missed cycle is skipped and counted."""

import time
from collections.abc import Callable
from typing import NamedTuple


class Cycle(NamedTuple):
    """One turn of the loop."""

    number: int
    scheduled_ns: int
    wake_ns: int
    missed: int


class Grid:
    """Slots at ``start_ns + n * period_ns``.

    ``following`` never hands out a cycle twice and never two cycles for one time: a loop that comes late runs the cycle
    it is in, and what lay between is missed, not caught up.
    """

    def __init__(self, start_ns: int, period_ns: int) -> None:
        self.start_ns, self.period_ns = start_ns, period_ns
        self._last = -1
        self.missed = 0

    def following(self, now_ns: int) -> tuple[int, int]:
        """Number and due time of the cycle to run next, given that it is ``now_ns``."""
        present = (now_ns - self.start_ns) // self.period_ns
        number = max(self._last + 1, present)
        self.missed += number - self._last - 1
        self._last = number
        return number, self.start_ns + number * self.period_ns


def sleep_until(due_ns: int) -> None:
    """Sleeps to an absolute time; CPython 3.11 does this with clock_nanosleep."""
    left_ns = due_ns - time.monotonic_ns()
    if left_ns > 0:
        time.sleep(left_ns * 1e-9)


def sleep_then_spin(
    spin_ns: int, now: Callable[[], int] = time.monotonic_ns, sleep: Callable[[int], None] = sleep_until
) -> Callable[[int], None]:
    """A sleep that ends ``spin_ns`` early and watches the clock for the rest.

    From a sleep the kernel comes back tens of microseconds late; only a loop that nothing else waits for may do so.
    """

    def until(due_ns: int) -> None:
        sleep(due_ns - spin_ns)
        while now() < due_ns:
            pass

    return until


class Executive:
    """Calls ``cycle`` once a cycle until it returns False."""

    def __init__(
        self,
        period_ns: int,
        now: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[int], None] = sleep_until,
    ) -> None:
        self._period_ns, self._now, self._sleep = period_ns, now, sleep

    def run(self, cycle: Callable[[Cycle], bool]) -> None:
        """Runs until ``cycle`` says no more."""
        grid = Grid(self._now() + self._period_ns, self._period_ns)
        running = True
        while running:
            number, due_ns = grid.following(self._now())
            self._sleep(due_ns)
            running = cycle(Cycle(number, due_ns, self._now(), grid.missed))
