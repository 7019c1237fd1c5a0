"""From replies to samples: when the axis was where it says, and how fast it went."""

from collections import deque

from drivers.zaber.codec import Scale, ZaberReply
from drivers.zaber.following import AxisPlace
from rig.channels import AxisSample

LOST_NS = 250_000_000  # a later reply could be that of the next command with the same number
# Five positions: over 40 ms of 100 Hz a late reply bends the speed by a quarter of what it bends one step.
OVER = 5


class PositionSamples:
    """``asked`` when a position is asked for, ``take`` for each reply; ``lost`` counts those that never came."""

    def __init__(self, scale: Scale, next_seq: int = 0) -> None:
        self.next_seq, self.lost = next_seq, 0
        self._scale = scale
        self._open: dict[int, int] = {}
        self._past: deque[tuple[int, float]] = deque(maxlen=OVER)

    def outstanding(self, now_ns: int) -> int:
        """Positions asked for and still to come; what is too late is lost."""
        self._drop([number for number, heard_ns in self._open.items() if now_ns - heard_ns > LOST_NS])
        return len(self._open)

    @property
    def place(self) -> AxisPlace | None:
        """Where the axis was last, and how fast; None before the first reply."""
        if not self._past:
            return None
        taken_ns, position_mm = self._past[-1]
        return AxisPlace(taken_ns * 1e-9, position_mm, self._velocity_mm_s())

    def asked(self, number: int, heard_ns: int) -> None:
        """Command ``number`` reaches the device at ``heard_ns``."""
        self._open[number] = heard_ns

    def take(self, reply: ZaberReply, now_ns: int, status: int, valid: bool) -> AxisSample | None:
        """The sample that ``reply`` completes; None where it is no position that was asked for."""
        heard_ns = self._open.get(reply.number) if reply.number is not None else None
        if heard_ns is not None and reply.number is not None:
            # Replies come in the order of their commands.
            self._drop([number for number, then_ns in self._open.items() if then_ns < heard_ns])
            del self._open[reply.number]
        steps = _number(reply.data) if reply.accepted else None
        if heard_ns is None or steps is None:
            return None
        capture_ns = min(heard_ns, now_ns)
        if self._past and capture_ns <= self._past[-1][0]:
            return None
        self._past.append((capture_ns, self._scale.mm(steps)))
        self.next_seq += 1
        place_mm, speed_mm_s = self._past[-1][1], self._velocity_mm_s()
        return AxisSample(self.next_seq - 1, capture_ns, now_ns, place_mm, speed_mm_s, float("nan"), status, int(valid))

    def _drop(self, numbers: list[int]) -> None:
        self.lost += len(numbers)
        for number in numbers:
            del self._open[number]

    def _velocity_mm_s(self) -> float:
        (first_ns, first_mm), (last_ns, last_mm) = self._past[0], self._past[-1]
        return (last_mm - first_mm) / (last_ns - first_ns) * 1e9 if last_ns > first_ns else 0.0


def _number(data: str) -> float | None:
    try:
        return float(data)
    except ValueError:
        return None
