"""The cyclic executive's clock: a grid on the monotonic clock; a missed cycle is skipped and counted."""

import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

from controller.loop.phase_lock import PhaseLock

# Share of a cycle before its beginning in which inputs that are there already are taken, and the clock is watched.
AHEAD = 0.25
# A look costs 10 us: with the sleep's own lateness a sample is found 30 us after it came, for a third of a core's time.
NAP_S = 20e-6


class Cycle(NamedTuple):
    """One turn of the loop: ``prepared_ns`` is what was done before it was due, ``waited_ns`` how long it looked for
    its sample after waking.
    """

    number: int
    scheduled_ns: int
    wake_ns: int
    missed: int
    prepared_ns: int = 0
    waited_ns: int = 0

    @property
    def began_ns(self) -> int:
        """When its inputs were complete."""
        return self.wake_ns + self.waited_ns


class Grid:
    """Slots ``period_ns`` apart from ``start_ns`` on, and as far away as ``move`` says.

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

    def move(self, later_ns: int) -> None:
        """Moves all cycles to come; by less than a period, as what lies between is no cycle missed."""
        self.start_ns += later_ns


class Work(Protocol):
    """What is done in each cycle."""

    def catch_up(self, now_ns: int) -> None:
        """Takes what may be a cycle old, straight after one: a frame of the tracker takes more than its end."""

    def prepare(self, now_ns: int) -> None:
        """Takes what else has come in since the last cycle, shortly before the next."""

    def take_force(self, now_ns: int) -> None:
        """Takes samples of the force sensor, and shows them to the phase lock."""

    def run_cycle(self, cycle: Cycle) -> bool:
        """The turn itself; False where it is the last."""


def sleep_until(due_ns: int) -> None:
    """Sleeps to an absolute time; CPython 3.11 does this with clock_nanosleep."""
    left_ns = due_ns - time.monotonic_ns()
    if left_ns > 0:
        time.sleep(left_ns * 1e-9)


def nap(_until_ns: int) -> None:
    """Between two looks at a line: who watches it without pause keeps the kernel's worker from filling it, and who
    waits for it in `select` waits for that worker as long as the computer is busy.
    """
    time.sleep(NAP_S)


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
    """Runs ``work`` once a cycle.

    ``sleep`` waits for a cycle's beginning, ``doze`` for what need not be on time; ``rest`` is called between two looks
    for a sample, with the end of waiting.
    """

    def __init__(
        self,
        now: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[int], None] = sleep_until,
        doze: Callable[[int], None] = sleep_until,
        rest: Callable[[int], None] = nap,
    ) -> None:
        self._now, self._sleep, self._doze, self._rest = now, sleep, doze, rest

    def run(self, work: Work, phase: PhaseLock) -> None:
        """Runs until ``work`` says no more, in step with ``phase``."""
        grid = Grid(self._now() + phase.period_ns, phase.period_ns)
        ahead_ns = round(AHEAD * phase.period_ns)
        running = True
        while running:
            number, due_ns = grid.following(self._now())
            prepared_ns = self._prepare(work, due_ns - ahead_ns)
            self._sleep(due_ns)
            wake_ns = self._now()
            waited_ns = self._look(work, phase, due_ns) - wake_ns
            running = work.run_cycle(Cycle(number, due_ns, wake_ns, grid.missed, prepared_ns, waited_ns))
            grid.move(phase.correction_ns(due_ns))

    def _prepare(self, work: Work, from_ns: int) -> int:
        """Between two cycles; how long it takes."""
        caught_up_ns = self._timed(work.catch_up)
        self._doze(from_ns)
        return caught_up_ns + self._timed(work.prepare)

    def _timed(self, part: Callable[[int], None]) -> int:
        began_ns = self._now()
        part(began_ns)
        return self._now() - began_ns

    def _look(self, work: Work, phase: PhaseLock, due_ns: int) -> int:
        """Looks at the force sensor until its sample is there or the time is over; when it last looked."""
        looked_ns, looks = self._now(), 1
        work.take_force(looked_ns)
        while looked_ns < (until_ns := phase.patience_ns(due_ns)):
            self._rest(until_ns)
            looked_ns, looks = self._now(), looks + 1
            work.take_force(looked_ns)
        phase.looked(looks)
        return looked_ns
