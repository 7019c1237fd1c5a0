"""The loop on a recording: its own cycles at their own times, with the samples that each of them had."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, cast

from controller.devices.drivers import Devices
from controller.devices.reopening import Openers
from controller.loop.bench_loop import BenchLoop
from controller.loop.carried import Carried
from controller.loop.executive import Cycle
from controller.loop.messages import StatusSaid
from controller.loop.steps import Program
from controller.replay.devices import RecordedAxis, RecordedStream
from controller.replay.given import Given
from controller.safety.table import TABLE, Check
from drivers.roles import ForceSensor, MarkerTracker
from rig.channel import Channel, Message
from rig.channels import EVENT, LOOP, EventSample, ForceSample, LoopSample, MarkerSample
from rig.config.wiring import Wiring
from rig.errors import DeviceError
from rig.recording.reader import Recording


@dataclass
class Collected:
    """In place of the ring: keeps what the loop decides, and shows the reader that the recording had."""

    loop: list[LoopSample] = field(default_factory=list)
    events: list[EventSample] = field(default_factory=list)
    given: Given = field(default_factory=Given)

    def put(self, stream_id: int, body: bytes) -> None:
        """One row."""
        if stream_id == LOOP.id:
            self.loop.append(cast(LoopSample, LOOP.unpack(body)))
        elif stream_id == EVENT.id:
            self.events.append(cast(EventSample, EVENT.unpack(body)))

    @property
    def fill(self) -> float:
        """As it was."""
        return self.given.recorder_fill

    def reader_age_ns(self, now_ns: int) -> int:  # noqa: ARG002 - as it was
        """As it was."""
        return round(self.given.recorder_silent_s * 1e9)


@dataclass
class Unheard:
    """In place of the supervisor: takes what the loop says and says nothing."""

    lost: bool = False

    def send(self, message: Message) -> int:  # noqa: ARG002 - nobody hears it
        """Nobody hears it."""
        return 0

    def send_newest(self, message: StatusSaid) -> None:
        """Nobody hears it."""

    def flush(self) -> bool:
        """All is gone."""
        return True


@dataclass
class RecordedCommands:
    """Starts the recorded program after the cycle at ``start_ns``, and asks for the stops that were asked for."""

    program: Program
    start_ns: int
    given: Given = field(default_factory=Given)
    now_ns: int = 0
    started: bool = False

    @property
    def heard_ns(self) -> int:
        """When the operator's program last said anything; 0 where that did not matter."""
        silent_s = self.given.operator_silent_s
        return self.now_ns - round(silent_s * 1e9) if silent_s else 0

    def stop_silent_s(self, now_ns: int) -> float:  # noqa: ARG002 - as it was
        """As it was."""
        return self.given.stop_silent_s

    def collect(self, loop: BenchLoop) -> frozenset[str]:
        """The start is an answer to a message, which is stamped with the cycle before."""
        if not self.started and loop.state.now_ns >= self.start_ns:
            self.started = True
            loop.start(self.program, 1)
        return self.given.requests

    def confirm(self, loop: BenchLoop) -> None:
        """Nobody waits for it."""

    def more(self, loop: BenchLoop) -> bool:  # noqa: ARG002 - the recording says when it ends
        """The recording says when it ends."""
        return True


class ReplayedLoop:
    """``cycle`` plays one recorded row; ``ring`` has what the loop made of it."""

    def __init__(
        self, wiring: Wiring, recording: Recording, periods_ns: Mapping[str, int], program: Program, start_ns: int,
        carried: Carried,
        table: tuple[Check, ...] = TABLE,
    ) -> None:  # fmt: skip
        rows = recording.tables
        self._now_ns = 0
        self._force = RecordedStream(ForceSample, rows["force"], periods_ns["force"])
        self._axis = RecordedAxis(rows["axis"], periods_ns["axis"])
        tools = wiring.tracker.tools if wiring.tracker else ()
        self._marker = RecordedStream(MarkerSample, rows["marker"], periods_ns["tracker"], tools) if tools else None
        devices = Devices(
            cast(ForceSensor, self._force), self._axis, cast(MarkerTracker, self._marker) if self._marker else None
        )
        self.ring, self._link = Collected(), Unheard()
        self.commands = RecordedCommands(program, start_ns)
        openers = Openers(dict.fromkeys(devices.by_role(), _gone), spawn=_never)
        link = cast(Channel, self._link)
        self.loop = BenchLoop(wiring, devices, self.ring, link, self.commands, lambda: self._now_ns, table, openers)
        carried.into(self.loop.state)

    def seed(self, row: LoopSample) -> None:
        """Each stream's newest sample before the first row, of which only its age is recorded."""
        ages = {"force": row.force_age_ns, "axis": row.axis_age_ns, "marker": row.marker_age_ns}
        for at, (stream, age_ns) in enumerate(ages.items()):
            valid = bool(row.health >> (3 * at + 1) & 1)
            self.loop.health[stream].update(row.capture_ns - age_ns, valid)

    def cycle(self, row: LoopSample, given: Given) -> LoopSample:
        """The row that the loop makes of the recorded one's samples and times."""
        self._now_ns = row.capture_ns + row.execution_ns
        self._force.upto(row.capture_ns, row.force_age_ns)
        self._axis.upto(row.capture_ns, row.axis_age_ns)
        if self._marker:
            self._marker.upto(row.capture_ns, row.marker_age_ns)
        self._give(given, row.capture_ns)
        wake_ns = row.scheduled_ns + row.wake_latency_ns
        self.loop.catch_up(row.capture_ns)
        self.loop.prepare(row.capture_ns)
        self.loop.take_force(row.capture_ns)
        waited_ns = row.capture_ns - wake_ns
        self.loop.run_cycle(Cycle(row.cycle, row.scheduled_ns, wake_ns, row.missed, waited_ns=waited_ns))
        return self.ring.loop[-1]

    def _give(self, given: Given, now_ns: int) -> None:
        self.ring.given = self.commands.given = given
        self.commands.now_ns = now_ns
        self._link.lost = self._link.lost or given.supervisor_lost
        self._axis.fault = given.drive_fault or self._axis.fault
        for code, device in (("axis_lost", self._axis), ("force_lost", self._force), ("tracker_lost", self._marker)):
            if device and code in given.lost:
                device.lost = given.lost[code]


def _gone() -> Any:
    raise DeviceError("a recorded device is not opened again")


def _never(work: Callable[[], None]) -> None:
    """Nothing runs beside a replay."""
