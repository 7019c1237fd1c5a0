"""From the drive's answers to a SYNC to samples: which SYNC an answer belongs to, and what is missing.

PDOs carry no number. Answers come in the order of their SYNCs, so the oldest SYNC without an answer is the one; after
an answer was lost, every later one would also fit the SYNC after that, and this is how the loss is noticed.
"""

from collections import deque

from drivers.epos4.cia402 import Statusword
from drivers.epos4.codec import DriveState, decode_state_pdo
from drivers.epos4.kind import DriveKind
from rig.channels import AxisSample

# Fifteen deliveries of a USB adapter: an answer still to come would be taken for the next SYNC's. Motion stops
# sooner (`loop.stale_axis_ms`), so that only the count of losses waits for it.
TIMEOUT_NS = 250_000_000
SUSPICIONS = 50
"""Answers in a row that would fit the next SYNC as well before one is given up as lost: 50 ms at 1 kHz, longer than an
adapter or a busy computer delays them all alike."""


class SyncMatcher:
    """Matches answers to SYNCs; ``lost`` counts SYNCs whose answer never came."""

    def __init__(self) -> None:
        self.lost = 0
        self._open: deque[int] = deque()
        self._shortest_ns = TIMEOUT_NS
        self._suspicions = 0

    def sent(self, now_ns: int) -> None:
        """A SYNC goes out."""
        while self._open and now_ns - self._open[0] > TIMEOUT_NS:
            self.drop()
        self._open.append(now_ns)

    def drop(self) -> None:
        """The answer to the oldest SYNC is known to be lost."""
        if self._open:
            self._open.popleft()
            self.lost += 1

    def answered(self, arrival_ns: int) -> int | None:
        """When the SYNC of this answer was sent; None where none is open."""
        if not self._open:
            return None
        if len(self._open) > 1 and arrival_ns - self._open[1] >= self._shortest_ns:
            self._suspicions += 1
        else:
            self._suspicions = 0
        if self._suspicions >= SUSPICIONS:
            self._suspicions = 0
            self.drop()
        sync_ns = self._open.popleft()
        self._shortest_ns = min(self._shortest_ns, arrival_ns - sync_ns)
        return sync_ns


class SampleBuilder:
    """Joins the two PDOs of one SYNC to a sample; numbers are contiguous, so a loss shows in ``lost`` only."""

    def __init__(self, kind: DriveKind, next_seq: int = 0) -> None:
        self.matcher = SyncMatcher()
        self.next_seq = next_seq
        self._kind = kind
        self._state: DriveState | None = None
        self._ready: list[AxisSample] = []

    def take_state(self, data: bytes, _now_ns: int) -> None:
        """TPDO1 came."""
        state = decode_state_pdo(data)
        if state is None:
            return
        if self._state is not None:
            self.matcher.drop()
        self._state = state

    def take_motion(self, data: bytes, now_ns: int) -> None:
        """TPDO2 came, which completes a sample."""
        motion, state = self._kind.decode_motion(data), self._state
        self._state = None
        if motion is None or state is None:
            self.matcher.drop()
            return
        sync_ns = self.matcher.answered(now_ns)
        if sync_ns is None:
            return
        units = self._kind.scale
        valid = 0 if state.status & Statusword.FAULT else 1
        current_A = units.direction * motion.current_mA / 1000
        self._ready.append(
            AxisSample(
                self.next_seq,
                sync_ns,
                now_ns,
                units.mm(state.increments),
                units.mm_s(motion.rpm),
                current_A,
                state.status,
                valid,
            )
        )
        self.next_seq += 1

    def collect(self) -> list[AxisSample]:
        """Samples completed since the last call."""
        ready, self._ready = self._ready, []
        return ready
