"""The stop word: a page of memory in which stops are asked for and the loop answers with their id and what it did.

Each who may ask has a lane with one writer, so nothing is ever locked: first the request's id is stored under its
kind, then under the lane's newest id, which is all that the loop looks at in a cycle without a request. An answer is
one word, id and deed together, stored after the time that belongs to it. Words are 64 bits and aligned: they reach
the other process whole, and in order (x86-64; elsewhere an answer may carry the time of the answer before).
"""

import contextlib
import mmap
import os
import threading
import time
from collections.abc import Callable, Iterator
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple, Self

from rig.errors import DeviceError

PAGE = 4096
MAGIC = int.from_bytes(b"tissstop", "little")
_MAGIC, _LOOP_PID, _LOOP_BEAT, _SERVER_PID, _KEYPAD, _SERVER_BEAT = range(6)
_LANES, _LANE_WORDS = 16, 32
# After the newest id, eight words each: room for eight kinds, within the lane.
_REQUESTS, _ANSWERS, _TIMES = 1, 9, 17
_DEED_BITS = 4  # fifteen deeds, of which there are six; 60 bits are left for ids
LOOK_S = 0.0005


class Lane(IntEnum):
    """Who asks."""

    STOP_PROCESS = 0
    SUPERVISOR = 1
    AWAY = 2


class StopReason(IntEnum):
    """What is asked for: to retract by the operator's or the subject's wish, to brake, to retract for what is lost."""

    STOP = 0
    PAIN = 1
    EMERGENCY = 2
    KEYPAD_LOST = 3
    RECORDING_LOST = 4


class Deed(IntEnum):
    """What the loop did."""

    HELD = 1
    RETRACTING = 2
    BRAKED = 3
    START_ENDED = 4
    START_BRAKED = 5
    AXIS_LOST = 6


DEEDS = {
    Deed.HELD: "nothing was moving: the axis stays where it is",
    Deed.RETRACTING: "retracting",
    Deed.BRAKED: "braked",
    Deed.START_ENDED: "nothing was moving: the bench does not start",
    Deed.START_BRAKED: "braked while the drive moved by itself: nothing starts",
    Deed.AXIS_LOST: "the axis does not answer the loop",
}
NOT_CONFIRMED = "NOT CONFIRMED: use the hardware stop"


class Keypad(IntEnum):
    """State of the foot switch or keypad."""

    NONE = 0
    OK = 1
    LOST = 2


class StopRequest(NamedTuple):
    """A stop that was asked for."""

    id: int
    kind: StopReason


class StopOutcome(NamedTuple):
    """What the loop did about a request, and when on the monotonic clock."""

    id: int
    deed: Deed
    time_ns: int

    @property
    def confirmed(self) -> bool:
        """Whether the axis heard of it."""
        return self.deed is not Deed.AXIS_LOST

    @property
    def text(self) -> str:
        """In words."""
        return DEEDS[self.deed]


class StopWord:
    """The mapped page; the file's owner alone can open it."""

    def __init__(self, path: Path, fd: int) -> None:
        self.path = path
        self._memory = mmap.mmap(fd, PAGE)
        self._view = memoryview(self._memory)
        self.words = self._view.cast("q")

    @classmethod
    def create(cls, path: Path) -> Self:
        """A new page; raises DeviceError where there is no memory for it."""
        try:
            fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        except OSError as error:
            raise DeviceError(f"{path}: the stop word cannot be created: {error.strerror}") from error
        try:
            os.posix_fallocate(fd, 0, PAGE)
            page = cls(path, fd)
        except OSError as error:
            path.unlink()
            raise DeviceError(f"{path}: no memory for the stop word: {error.strerror}; free some") from error
        finally:
            os.close(fd)
        page.words[_MAGIC] = MAGIC
        return page

    @classmethod
    def open(cls, path: Path) -> Self:
        """The page at ``path``; raises DeviceError where it is none."""
        try:
            fd = os.open(path, os.O_RDWR)
        except OSError as error:
            raise DeviceError(f"{path}: no stop word: {error.strerror}") from error
        try:
            if os.fstat(fd).st_size != PAGE or os.pread(fd, 8, 0) != MAGIC.to_bytes(8, "little"):
                raise DeviceError(f"{path}: not a stop word of this program")
            return cls(path, fd)
        finally:
            os.close(fd)

    @property
    def loop_pid(self) -> int:
        """Process number of the loop; 0 before it has come."""
        return self.words[_LOOP_PID]

    @property
    def loop_beat_ns(self) -> int:
        """When the loop last looked; 0 before its first cycle."""
        return self.words[_LOOP_BEAT]

    @property
    def server_pid(self) -> int:
        """Process number of the stop process, set once it serves."""
        return self.words[_SERVER_PID]

    @property
    def keypad(self) -> Keypad:
        """State of the foot switch or keypad."""
        return Keypad(self.words[_KEYPAD])

    def serve(self, pid: int) -> None:
        """The stop process serves."""
        self.words[_SERVER_PID] = pid

    def beat(self, now_ns: int) -> None:
        """The stop process looks for presses."""
        self.words[_SERVER_BEAT] = now_ns

    def show_keypad(self, state: Keypad) -> None:
        """Says how the keypad is."""
        self.words[_KEYPAD] = state

    def close(self, unlink: bool = False) -> None:
        """Lets go of the page, may be called twice; ``unlink`` removes the file, which others keep."""
        if not self._memory.closed:
            self.words.release()
            self._view.release()
            self._memory.close()
        if unlink:
            self.path.unlink(missing_ok=True)


@contextlib.contextmanager
def _open_page() -> Iterator[None]:
    try:
        yield
    except ValueError as error:  # of a memoryview that was released
        raise DeviceError("the bench is not running") from error


class Requester:
    """The asking end of one lane; safe from any thread of the one process that has it."""

    def __init__(self, page: StopWord, lane: Lane) -> None:
        self._words, self._base = page.words, _LANES + lane * _LANE_WORDS
        self._lock = threading.Lock()

    def request(self, kind: StopReason) -> StopRequest:
        """Asks; the loop sees it in its next cycle. Raises DeviceError where the page was given back."""
        with self._lock, _open_page():
            number = self._words[self._base] + 1
            self._words[self._base + _REQUESTS + kind] = number
            self._words[self._base] = number
        return StopRequest(number, kind)

    def answer(self, request: StopRequest) -> StopOutcome | None:
        """What was done about ``request``, or a later one of its kind; None before that. Raises as ``request``."""
        with _open_page():
            word = self._words[self._base + _ANSWERS + request.kind]
            time_ns = self._words[self._base + _TIMES + request.kind]
        if word >> _DEED_BITS < request.id:
            return None
        return StopOutcome(request.id, Deed(word & ((1 << _DEED_BITS) - 1)), time_ns)

    def confirmed(
        self,
        request: StopRequest,
        within_s: float,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> StopOutcome | None:
        """The answer to ``request``, waited for; None where it has not come within ``within_s``."""
        deadline = now() + within_s
        while (answer := self.answer(request)) is None and now() < deadline:
            sleep(LOOK_S)
        return answer


class Responder:
    """The loop's end of all lanes."""

    def __init__(self, page: StopWord) -> None:
        self._words = page.words
        self._seen = {_LANES + lane * _LANE_WORDS: 0 for lane in Lane}
        self._pending: dict[tuple[int, StopReason], StopRequest] = {}

    def attach(self, pid: int) -> None:
        """The loop is there; what was asked before counts."""
        self._words[_LOOP_PID] = pid

    def take(self, now_ns: int) -> tuple[StopRequest, ...]:
        """What has been asked and not answered yet; called every cycle."""
        words = self._words
        words[_LOOP_BEAT] = now_ns
        for base, seen in self._seen.items():
            if words[base] != seen:
                self._collect(base)
        return tuple(self._pending.values()) if self._pending else ()

    def server_silent_s(self, now_ns: int) -> float:
        """Since the stop process last looked for presses [s]; it has before the loop comes."""
        return (now_ns - self._words[_SERVER_BEAT]) * 1e-9

    def _collect(self, base: int) -> None:
        words = self._words
        self._seen[base] = words[base]
        for kind in StopReason:
            number = words[base + _REQUESTS + kind]
            if number > words[base + _ANSWERS + kind] >> _DEED_BITS:
                self._pending[base, kind] = StopRequest(number, kind)

    def answer(self, deed: Deed, now_ns: int) -> None:
        """Answers all that has been taken."""
        for (base, kind), request in self._pending.items():
            self._words[base + _TIMES + kind] = now_ns
            self._words[base + _ANSWERS + kind] = request.id << _DEED_BITS | deed
        self._pending.clear()
