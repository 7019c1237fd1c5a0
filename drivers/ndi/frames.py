"""From tracking replies to samples: which frames are new, which were passed over, and when each was taken."""

import math
from collections.abc import Sequence

from drivers.ndi.replies import Pose, ToolReading, TrackingReply
from drivers.roles import LinkCounters
from rig.channels import MarkerSample
from rig.config.products.ndi_polaris import PolarisWiring
from rig.timing import ClockMap, Unwrapper

COUNTER_HZ = 60
"""The frame counter advances at this rate whatever the rate of the tools (Vega API guide, frame number)."""
_NO_FRAME = -1  # below every counter, so that the newest of several is one that was seen
_LONG_NS = 1 << 62
_NO_POSE = Pose(*[math.nan] * 8)


class FrameReader:
    """Follows the frame numbers of the tools with these ``handles``, given in the order of ``config.tools``.

    A frame is counted once: in ``counters.frames`` where it brought samples, in ``counters.device_lost`` where the
    number jumped over it.
    """

    def __init__(
        self, handles: Sequence[int], config: PolarisWiring, counters: LinkCounters, next_seq: int = 0
    ) -> None:
        self.next_seq = next_seq
        self._handles = tuple(handles)
        self._step = max(1, round(COUNTER_HZ / config.rate_Hz))
        self._counters = counters
        self._clock = ClockMap(latency_ns=round(config.latency_ms * 1e6))
        self._unwrap = Unwrapper(32)
        self._quickest_ns = _LONG_NS
        self._newest = _NO_FRAME
        self._last = [_NO_FRAME] * len(handles)
        self._last_ns = [-_LONG_NS] * len(handles)

    def samples(self, reply: TrackingReply, asked_ns: int, arrival_ns: int) -> list[MarkerSample]:
        """One sample for each tool whose frame is new; none where the reply repeats a frame.

        The tracker answers with the newest frame it has when asked, so the question, not the answer, dates it: at the
        latest when it was sent and all that this exchange took longer than the quickest, which may have held it up.
        """
        self._quickest_ns = min(self._quickest_ns, arrival_ns - asked_ns)
        heard_ns = arrival_ns - self._quickest_ns
        readings = {tool.handle: tool for tool in reply.tools}
        tools = [readings.get(handle) for handle in self._handles]
        frames = [self._unwrap(tool.frame) if tool and tool.frame is not None else _NO_FRAME for tool in tools]
        newest = max(frames, default=_NO_FRAME)
        if newest <= self._newest:
            return []
        self._count(newest)
        taken_ns = newest * 1_000_000_000 // COUNTER_HZ
        self._clock.observe(taken_ns, heard_ns)
        (newest_ns,) = self._clock.captures([taken_ns], heard_ns)
        samples = []
        for index, tool in enumerate(tools):
            # A disabled tool has no frame number of its own; active tools have theirs a frame or two apart.
            frame = newest if frames[index] == _NO_FRAME else frames[index]
            if frame > self._last[index]:
                self._last[index] = frame
                capture_ns = newest_ns - (newest - frame) * 1_000_000_000 // COUNTER_HZ
                # While the map finds its offset, an older frame may lie further back than time went on.
                self._last_ns[index] = capture_ns = max(capture_ns, self._last_ns[index] + 1)
                samples.append(self._sample(index, tool, frame, capture_ns, arrival_ns))
        return samples

    def _count(self, newest: int) -> None:
        self._counters.frames += 1
        if self._newest != _NO_FRAME:
            self._counters.device_lost += max(0, (newest - self._newest) // self._step - 1)
        self._newest = newest

    def _sample(
        self, index: int, tool: ToolReading | None, frame: int, capture_ns: int, arrival_ns: int
    ) -> MarkerSample:
        pose = tool.pose if tool and isinstance(tool.pose, Pose) else _NO_POSE
        q0, qx, qy, qz, x_mm, y_mm, z_mm, error_mm = pose
        self.next_seq += 1
        return MarkerSample(
            self.next_seq - 1, capture_ns, arrival_ns, frame, index,
            x_mm, y_mm, z_mm, q0, qx, qy, qz, error_mm, int(pose is not _NO_POSE),
        )  # fmt: skip
