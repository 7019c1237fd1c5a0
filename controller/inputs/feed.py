"""What the loop takes of its inputs, a few rows a cycle: into its own ring, and as stops where a switch asks for one.

It looks into shared memory alone. An input that is lost is shown; motion depends only on one that is needed.
"""

import struct
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Protocol

from controller.devices.states import DeviceState, DeviceStatus, connecting
from controller.inputs.states import INPUT_STATE, InputState
from controller.loop.commands import REQUESTS
from controller.safety.table import Action
from controller.stop.word import StopReason
from rig.channels import Stream
from rig.config.products.input_role import InputProduct
from rig.config.stop import StopKind
from rig.input_streams import input_streams
from rig.recording.ring import RingReader

if TYPE_CHECKING:
    from controller.loop.bench_loop import BenchLoop

# In a cycle of a millisecond that is a stream of 16 kHz; the rest waits in the ring.
MOST_ROWS = 16
# Five times what lies between two of its words: the process of the inputs is gone, or hangs.
SILENT_NS = 1_000_000_000
REASONS: Mapping[StopKind, StopReason] = {
    "stop": StopReason.STOP,
    "pain": StopReason.PAIN,
    "emergency": StopReason.EMERGENCY,
}


class RowRing(Protocol):
    """Where rows go."""

    def put(self, stream_id: int, body: bytes) -> None:
        """Publishes one row."""


class InputFeed:
    """The inputs of one bench; ``collect`` is called once a cycle and never waits."""

    def __init__(self, inputs: Mapping[str, InputProduct], source: RingReader, target: RowRing, now_ns: int) -> None:
        self._inputs, self._source, self._target = tuple(inputs.items()), source, target
        streams = input_streams({name: product.channels for name, product in inputs.items()})
        self._switches = {
            stream.id: (stream, product)
            for stream, product in zip(streams, inputs.values(), strict=True)
            if product.asks_for
        }
        self.statuses = {name: connecting(now_ns) for name in inputs}
        self._heard_ns = now_ns

    def collect(self, loop: "BenchLoop") -> frozenset[str]:
        """Relays what has come, takes down states, and returns the stops that were asked for."""
        now_ns = loop.state.now_ns
        asked: frozenset[str] = frozenset()
        for stream_id, body in self._rows():
            if stream_id == INPUT_STATE.id:
                self._hear(loop, InputState(*INPUT_STATE.unpack(body)), now_ns)
            else:
                self._target.put(stream_id, body)
                asked |= self._asked(stream_id, body)
        self._notice_silence(loop, now_ns)
        loop.input_statuses = self.statuses
        loop.inputs.input_lost = self.lost()
        return asked

    def _rows(self) -> Iterator[tuple[int, bytes]]:
        """Numbers of streams and bodies; most cycles bring none, and look at one word alone."""
        if self._source.head == self._source.position:
            return
        for slot in self._source.drain(MOST_ROWS):
            yield int(slot["stream"]), slot["body"][: slot["size"]].tobytes()

    def _asked(self, stream_id: int, body: bytes) -> frozenset[str]:
        stream, product = self._switches.get(stream_id, (None, None))
        if stream is None or product is None or not product.asks_for:
            return frozenset()
        return REQUESTS[REASONS[product.asks_for]] if _pressed(stream, product, body) else frozenset()

    def _hear(self, loop: "BenchLoop", said: InputState, now_ns: int) -> None:
        self._heard_ns = max(self._heard_ns, said.capture_ns)
        name = self._inputs[said.input][0]
        self._set(loop, name, DeviceState(said.state), said.detail, now_ns)

    def _notice_silence(self, loop: "BenchLoop", now_ns: int) -> None:
        if now_ns - self._heard_ns > SILENT_NS:
            for name, _ in self._inputs:
                self._set(loop, name, DeviceState.LOST, "the process of the inputs says nothing; start again", now_ns)

    def _set(self, loop: "BenchLoop", name: str, state: DeviceState, detail: str, now_ns: int) -> None:
        before = self.statuses[name]
        if (before.state, before.detail) == (state, detail):
            return
        since_ns = before.since_ns if before.state is state else now_ns
        self.statuses = self.statuses | {name: DeviceStatus(state, detail, since_ns)}
        if before.state is not state:
            well = state in (DeviceState.OK, DeviceState.CONNECTING)
            text = f"input {name} {state}: {detail}".rstrip(": ")
            loop.event(Action.NOTE if well else Action.WARNING, "input_state", text, now_ns)

    def lost(self) -> str:
        """Why nothing may move: the first input that is needed and is not there; empty if none."""
        for name, product in self._inputs:
            status = self.statuses[name]
            if product.is_needed and status.state not in (DeviceState.OK, DeviceState.DEGRADED):
                return f"input {name} is {status.state}: {status.detail}"
        return ""

    def close(self) -> None:
        """Lets go of the ring."""
        self._source.close()


def _pressed(stream: Stream, product: InputProduct, body: bytes) -> bool:
    try:
        row = dict(zip(stream.kinds, stream.unpack(body), strict=True))
    except struct.error:
        return False
    return bool(row[product.switch] == 1)
