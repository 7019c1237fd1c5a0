"""When the frames of a stream without a counter were sampled: their place in the stream is the sensor's clock.

The sensor samples by its own clock, whatever delays its bytes: a frame that comes late is no later a sample. Counting
goes wrong only where frames are lost. Their bytes tell, where some are left; else that everything after them comes
whole periods late and stays so, while what was merely delayed is followed by the rest of its burst.
"""

from collections.abc import Sequence

from drivers.robotiq.codec import FRAME_BYTES, FRAME_NS, STREAM_HZ
from rig.timing import ClockMap

PERIOD_NS = 1_000_000_000 // STREAM_HZ
# No manual says how exact 100 Hz are. The sensor's clock also makes its baud rate, and one further off than 2 % could
# not be read: half a bit in nine and a half (5 %) is what 8N1 leaves to both ends (Maxim, application note 2141).
RATE_PPM = 20_000.0
# A USB adapter delivers every 16 ms; ten reads at the stream's own pace meet the end of such a wait.
STEADY_READS = 10
# A kernel keeps 4095 bytes of an unread line, 2.5 s of the stream, and drops the rest.
PAUSE_NS = 2_000_000_000
# One second of the stream: its quickest frame is known, and with it what no later one undercuts by half a period.
SETTLED_FRAMES = STREAM_HZ
# What the clock map wants to see to know how far the stream's rate is from 100 Hz.
LISTEN_NS = 2_100_000_000


class FrameClock:
    """Counts the frames of one stream, ``lost`` ones too.

    ``latency_ns`` is the known smallest delay apart from the frame's time on the line.
    """

    def __init__(self, latency_ns: int) -> None:
        self.lost = 0
        self._map = ClockMap(FRAME_NS + latency_ns, RATE_PPM)
        self.restart()

    def restart(self) -> None:
        """A new stream begins."""
        self._map.restart()
        self._index = -1
        self._late_ns = 0
        self._steady_ns: list[int] = []
        self._read_ns = self._judged_ns = -PAUSE_NS

    def take(self, gaps: Sequence[int], arrival_ns: int) -> list[int]:
        """Device times of frames that came together [ns], oldest first; ``gaps`` are the bytes lost before each."""
        devices_ns = [self._next_ns(gap, arrival_ns) for gap in gaps]
        if devices_ns:
            self._judge(self._late_ns, arrival_ns)
        return devices_ns

    def _next_ns(self, gap: int, arrival_ns: int) -> int:
        last = self._index
        self._skip(self._missing(gap, arrival_ns))
        self._index += 1
        self._late_ns = self._lateness_ns(0, arrival_ns)
        if last >= SETTLED_FRAMES and self._late_ns < -PERIOD_NS // 2:
            # No frame comes before it was sent: frames were counted as lost that came.
            self._skip(max(round(self._late_ns / PERIOD_NS), last - self._index))
        self._map.observe(self._index * PERIOD_NS, arrival_ns)
        return self._index * PERIOD_NS

    def _skip(self, frames: int) -> None:
        self._index += frames
        self.lost += frames

    def _lateness_ns(self, ahead: int, arrival_ns: int) -> int:
        number = self._index + ahead
        return self._map.lateness_ns(number * PERIOD_NS, arrival_ns) if number else 0

    def captures(self, devices_ns: Sequence[int], arrival_ns: int) -> list[int]:
        """Host times at which these frames were sampled, see ``ClockMap.captures``."""
        return self._map.captures(devices_ns, arrival_ns)

    def _missing(self, gap: int, arrival_ns: int) -> int:
        """How many frames a gap of bytes was: no more than arrival leaves room for; none comes before it was sent."""
        most = -(-gap // FRAME_BYTES)
        return max(0, min(most, round(self._lateness_ns(1, arrival_ns) / PERIOD_NS)))

    def _judge(self, late_ns: int, arrival_ns: int) -> None:
        """Takes lasting lateness of the newest frame of a read for frames lost without a trace."""
        paused, self._read_ns = arrival_ns - self._read_ns > PAUSE_NS, arrival_ns
        if paused:
            # What came now was kept from the pause's beginning; the read after it tells what was dropped.
            self._steady_ns = [late_ns] * (STEADY_READS - 1)
        elif late_ns <= PERIOD_NS // 2:
            self._steady_ns = []
        elif arrival_ns - self._judged_ns >= PERIOD_NS // 2:
            self._judged_ns = arrival_ns
            self._steady_ns.append(late_ns)
        if len(self._steady_ns) >= STEADY_READS:
            self._skip(round(min(self._steady_ns) / PERIOD_NS))
            self._steady_ns = []
