"""``BenchLoop`` whole, with everything around it in one thread on one clock: thousands of cycles a second of CPU.

``bench = FakeBench(); bench.run(ZERO, APPROACH); bench.force.frozen = True; bench.until(lambda: bench.mode is SAFE)``
"""

import contextlib
import copy
import json
import math
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any, cast

from controller.devices.drivers import Devices
from controller.devices.reopening import Openers
from controller.loop.bench_loop import BenchLoop
from controller.loop.commands import Inbox
from controller.loop.executive import Cycle
from controller.loop.messages import (
    Finished,
    Heartbeat,
    Note,
    Recover,
    Reset,
    Run,
    Shutdown,
    Status,
    StatusSaid,
    Stopped,
    Survey,
    Surveyed,
)
from controller.loop.modes import Mode
from controller.loop.steps import Approach, Compress, Hold, Program, Retract, Step, Zero
from controller.safety.table import TABLE, Check
from controller.stop.word import PAGE, Lane, Requester, Responder, StopReason, StopRequest, StopWord
from controller.stop.word import StopOutcome as StopAnswer
from drivers.roles import Device
from mock_devices.testing.clock import Clock
from rig.channel import Answer, Channel, Message, Received
from rig.channels import (
    AXIS,
    BY_ID,
    EVENT,
    FORCE,
    LOOP,
    MARKER,
    AxisSample,
    EventSample,
    ForceSample,
    LoopSample,
    MarkerSample,
)
from rig.config.wiring import Wiring
from rig.errors import DeviceError
from tests.calibrations import with_calibration
from tests.controller.fake_devices import FakeAxis, FakeDevice, FakeForce, FakeTracker

ZERO = Zero(duration_s=0.2)
APPROACH = Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0)
PRESS = Compress(depth_mm=5.0, speed_mm_s=20.0, force_limit_N=9.0)
LEAVE = Retract(clearance_mm=5.0, speed_mm_s=10.0)
HOLD = Hold(duration_s=30.0)
SETTLED_CYCLES = 20
"""Cycles before a test begins: no bench is asked to move before its devices have spoken."""


def wired(sensor_Hz: float = 1000.0, **sections: dict[str, Any] | None) -> Wiring:
    """The default wiring with a force sensor of that rate: 100 Hz is the FT 300."""
    product = "robotiq-ft300" if sensor_Hz == 100.0 else "bota-sensone"
    force = {"product": product, "rate_Hz": 1000.0 if sensor_Hz == 100.0 else sensor_Hz} | (
        sections.pop("force", None) or {}
    )
    return Wiring.model_validate({"force": force, **sections})


@dataclass
class FakeRing:
    """Keeps every row by stream, unpacked again from its bytes; ``fill`` and ``silent_s`` are what the reader shows."""

    fill: float = 0.0
    silent_s: float = 0.0
    asked_ns: int = 0
    rows: dict[int, list[tuple[Any, ...]]] = field(default_factory=lambda: {stream: [] for stream in BY_ID})

    def put(self, stream_id: int, body: bytes) -> None:
        """One row."""
        self.rows[stream_id].append(BY_ID[stream_id].unpack(body))

    def reader_age_ns(self, now_ns: int) -> int:
        """As long as the test says."""
        self.asked_ns = now_ns
        return round(self.silent_s * 1e9)

    @property
    def loop(self) -> list[LoopSample]:
        """The rows of the loop itself."""
        return cast(list[LoopSample], self.rows[LOOP.id])

    @property
    def events(self) -> list[EventSample]:
        """What happened."""
        return cast(list[EventSample], self.rows[EVENT.id])

    @property
    def force(self) -> list[ForceSample]:
        """Rows of the force sensor."""
        return cast(list[ForceSample], self.rows[FORCE.id])

    @property
    def axis(self) -> list[AxisSample]:
        """Rows of the axis."""
        return cast(list[AxisSample], self.rows[AXIS.id])

    @property
    def marker(self) -> list[MarkerSample]:
        """Rows of the tracker."""
        return cast(list[MarkerSample], self.rows[MARKER.id])


SAID: dict[str, Callable[..., Message]] = {
    "program": Run,
    "lease": lambda: Heartbeat(attending=True),
    "unattended": lambda: Heartbeat(attending=False),
    "reset": Reset,
    "note": Note,
    "shutdown": Shutdown,
    "survey": Survey,
    "recover": Recover,
}
KINDS = {
    "stop": StopReason.STOP,
    "pain": StopReason.PAIN,
    "estop": StopReason.EMERGENCY,
    "keypad": StopReason.KEYPAD_LOST,
    "recording": StopReason.RECORDING_LOST,
}
HEARD: dict[str, type[Message]] = {"finished": Finished, "incident": Stopped, "answer": Answer, "surveyed": Surveyed}


@dataclass
class FakeLink:
    """The loop's end of the channel: what the other end says is put into ``inbox``; what the loop says is kept."""

    inbox: deque[Message] = field(default_factory=deque)
    sent: list[Message] = field(default_factory=list)
    statuses: list[Status] = field(default_factory=list)
    flushes: int = 0
    lost: bool = False
    refused: int = 0
    received: int = 0

    def send(self, message: Message) -> int:
        """Kept."""
        self.sent.append(message)
        return len(self.sent)

    def send_newest(self, message: StatusSaid) -> None:
        """Kept apart."""
        self.statuses.append(message.status)

    def flush(self) -> bool:
        """Counts."""
        self.flushes += 1
        return True

    def receive(self) -> Received | None:
        """The oldest message; its id is how many there were before."""
        if not self.inbox:
            return None
        self.received += 1
        return Received(self.received, self.inbox.popleft())

    def of(self, kind: str) -> list[dict[str, Any]]:
        """What the loop said of this kind, in order; of a finished program its outcome."""
        found = [message.model_dump() for message in self.sent if isinstance(message, HEARD[kind])]
        return [said.get("outcome", said) for said in found]


@dataclass
class FakePage:
    """The stop word in memory of this process."""

    words: list[int] = field(default_factory=lambda: [0] * (PAGE // 8))


def _at_once(work: Callable[[], None]) -> None:
    work()


class FakeBench:
    """Everything wired together; ``cycle`` is one period of the loop."""

    def __init__(
        self,
        wiring: Wiring | None = None,
        position_mm: float = 10.0,
        execution_ns: int = 50_000,
        settled: int = SETTLED_CYCLES,
        held: str = "",
        table: tuple[Check, ...] = TABLE,
    ) -> None:
        self.wiring = with_calibration(wiring or wired(), FakeForce.__name__, "1")
        self.clock = Clock()
        self.period_ns = round(1e9 / self.wiring.loop.rate_Hz)
        self.axis = FakeAxis(self.clock, self.period_ns, position_mm=position_mm, target_mm=position_mm)
        self.force = FakeForce(
            self.clock, round(1e9 / self.wiring.force.sampled_Hz), axis=self.axis, wiring=self.wiring
        )
        rate_Hz = self.wiring.tracker.rate_Hz if self.wiring.tracker else 60.0
        self.tracker = FakeTracker(self.clock, round(1e9 / rate_Hz), axis=self.axis)
        self.ring, self.link = FakeRing(), FakeLink()
        self.devices = Devices(self.force, self.axis, self.tracker if self.wiring.tracker else None)
        link = cast(Channel, self.link)
        self.page = page = cast(StopWord, FakePage())
        self.stops, self.asked = Requester(page, Lane.STOP_PROCESS), list[StopRequest]()
        # A bench is copied whole by some tests, and a lock cannot be.
        self.stops._lock = cast(threading.Lock, contextlib.nullcontext())
        self.responder = Responder(page)
        inbox = Inbox(link, self.responder)
        self.spares: dict[str, FakeDevice] = {}
        self.attempts: list[str] = []
        self.loop = BenchLoop(
            self.wiring,
            self.devices,
            self.ring,
            link,
            inbox,
            self.clock,
            table,
            opens=Openers(self._openers(), _at_once),
            held=held,
        )
        self.cycle_number = self.missed = 0
        self.execution_ns = execution_ns
        self.start_ns = self.clock.now_ns
        self.going = True
        self.true_peak_N = 0.0
        self.keep_lease = self.stop_process_lives = True
        self.cycles(settled)

    def _openers(self) -> dict[str, Callable[[], Device]]:
        """A lost device comes back where a spare was put; until then each attempt fails."""

        def opened(role: str) -> Device:
            self.attempts.append(role)
            if role not in self.spares:
                raise DeviceError(f"{role}: still unplugged")
            return cast(Device, self.spares.pop(role))

        return {role: partial(opened, role) for role in self.devices.by_role()}

    @property
    def mode(self) -> Mode:
        """What the machine does."""
        return self.loop.machine.mode

    @property
    def latched(self) -> str:
        """Code of the stop in force; empty without one."""
        latched = self.loop.machine.latched
        return latched.code if latched else ""

    @property
    def time_s(self) -> float:
        """Since the start."""
        return (self.clock.now_ns - self.start_ns) * 1e-9

    def cycle(self, late_ns: int = 0, held_ns: int = 0) -> bool:
        """One cycle, woken ``late_ns`` after it was due, held up for ``held_ns``; whole periods are missed."""
        due_ns = self.start_ns + self.cycle_number * self.period_ns
        wake_ns = due_ns + late_ns
        self.axis.advance(wake_ns)
        self.clock.now_ns = wake_ns
        self._renew()
        if self.stop_process_lives:
            StopWord.beat(self.page, wake_ns)
        self.loop.catch_up(wake_ns)
        self.loop.prepare(wake_ns)
        self.loop.take_force(wake_ns)
        self.going = self.loop.run_cycle(Cycle(self.cycle_number, due_ns, wake_ns, self.missed))
        self.clock.now_ns = wake_ns + self.execution_ns + held_ns
        self.true_peak_N = max(self.true_peak_N, self.force.true_N)
        skipped = (late_ns + held_ns) // self.period_ns
        self.cycle_number, self.missed = self.cycle_number + 1 + skipped, self.missed + skipped
        return self.going

    def _renew(self) -> None:
        if self.keep_lease and not self.link.inbox and self.cycle_number % 100 == 0:
            self.say("lease")

    def cycles(self, count: int) -> None:
        """That many, on time."""
        for _ in range(count):
            self.cycle()

    def wait(self, seconds: float) -> None:
        """Cycles for that long."""
        self.cycles(round(seconds * 1e9 / self.period_ns))

    def until(self, condition: Callable[[], bool], within_s: float = 60.0) -> float:
        """Cycles until ``condition``; returns how long that took, or fails."""
        began_ns = self.clock.now_ns
        while not condition():
            assert (self.clock.now_ns - began_ns) * 1e-9 < within_s, f"still {self.mode.name} {self.latched}"
            self.cycle()
        return (self.clock.now_ns - began_ns) * 1e-9

    def say(self, verb: str, **more: object) -> None:
        """A message to the loop, or a stop, taken in the next cycle."""
        if verb in KINDS:
            self.asked.append(self.stops.request(KINDS[verb]))
            return
        self.link.inbox.append(SAID[verb](**more))

    def stop_answers(self) -> list[StopAnswer | None]:
        """What the loop answered to each stop so far, in order."""
        return [self.stops.answer(request) for request in self.asked]

    def begin(self, *steps: Step) -> None:
        """Sends a program; the next cycle starts it."""
        self.say("program", program=Program(name="test", steps=steps))
        self.cycles(len(self.link.inbox))

    def run(self, *steps: Step, within_s: float = 60.0) -> dict[str, Any]:
        """A program to its end; returns what the loop said of it."""
        before = len(self.link.of("finished"))
        self.begin(*steps)
        self.until(lambda: len(self.link.of("finished")) > before, within_s)
        return self.link.of("finished")[-1]

    def press(self, force_N: float = 3.0) -> None:
        """Into the tissue until the loop sees that force, then holding."""
        depth_mm = force_N / self.force.stiffness_N_mm
        self.begin(ZERO, APPROACH, Compress(depth_mm=depth_mm, speed_mm_s=10.0, force_limit_N=force_N + 2.0), HOLD)
        self.until(lambda: self.loop.machine.step_index == 3)
        self.wait(0.1)
        assert math.isclose(self.force.true_N, force_N, abs_tol=0.6), self.force.true_N


def pressing(sensor_Hz: float = 1000.0, sections: Mapping[str, dict[str, Any] | None] | None = None) -> FakeBench:
    """A bench that presses with 3 N and holds; its histories begin there."""
    return copy.deepcopy(_pressed(sensor_Hz, json.dumps(sections or {})))


@cache
def _pressed(sensor_Hz: float, sections: str) -> FakeBench:
    bench = FakeBench(wired(sensor_Hz, **json.loads(sections)))
    bench.press(3.0)
    for rows in bench.ring.rows.values():
        rows.clear()
    del bench.axis.commands[:], bench.axis.requests[:], bench.axis.calls[:], bench.link.sent[:], bench.link.statuses[:]
    return bench
