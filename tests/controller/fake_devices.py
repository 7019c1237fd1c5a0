"""Devices of a bench that is not there, on an injected clock: each has knobs for what may go wrong and keeps a history.

The axis follows its set-point with a first-order lag, solved exactly from cycle to cycle; the tissue is a linear spring
below ``surface_mm``, so that what the loop should see has a closed form.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from drivers.roles import Identity, LinkCounters
from mock_devices.testing.clock import Clock
from rig.channels import AxisSample, ForceSample, MarkerSample
from rig.config.wiring import Wiring
from rig.errors import DeviceError

Triple: TypeAlias = tuple[float, float, float]

ZERO_N = 0.8
SURFACE_MM = 20.0
STIFFNESS_N_MM = 1.0
AT_ONCE = 15  # reports of an axis in one poll
DITHER_N = (0.0, 0.001, -0.001)
"""Noise of the converter, the same every three samples: without any, three samples are a frozen sensor."""


@dataclass
class FakeDevice:
    """What all devices share: ``cut`` makes every call fail, as an unplugged cable does."""

    clock: Clock
    period_ns: int
    cut: str = ""
    silent: bool = False
    closed: bool = False
    counters: LinkCounters = field(default_factory=LinkCounters)
    calls: list[str] = field(default_factory=list)
    next_seq: int = 0
    serial: str = "1"
    settings: dict[str, str] = field(default_factory=dict)

    @property
    def identity(self) -> Identity:
        """Who it claims to be."""
        return Identity(type(self).__name__, self.serial, "1", self.settings)

    def start(self) -> None:
        """Counts as a call; fails where the cable is cut."""
        self.called("start")

    def fileno(self) -> int:
        """There is nothing to wait on."""
        return -1

    def close(self) -> None:
        """Notes that it was closed."""
        self.closed = True

    def called(self, name: str) -> None:
        """Notes a call, and raises where the cable is cut."""
        self.calls.append(name)
        if self.cut:
            raise DeviceError(self.cut)


@dataclass
class FakeAxis(FakeDevice):
    """A servo axis with a lag of ``lag_s``; 0 is an axis that is where it is told to be.

    What is ``held_up`` on its way comes when that is over, a few at a time; ``silent``, it never comes.
    """

    position_mm: float = 10.0
    lag_s: float = 0.0047
    on: bool = True
    limp: bool = False
    fault_text: str = ""
    blocked: bool = False
    reads_mm: float | None = None
    held_up: bool = False
    scale: float = 1.0
    velocity_mm_s: float | None = None
    valid: bool = True
    unstoppable: str = ""
    unclearable: str = ""
    commands: list[tuple[int, float]] = field(default_factory=list)
    requests: list[int] = field(default_factory=list)
    quick_stops: list[int] = field(default_factory=list)
    target_mm: float = math.nan
    referenced: bool = True
    remembered: tuple[str, ...] = ()
    home_mm: float = math.nan
    _due: deque[tuple[int, float, float]] = field(default_factory=deque)
    _moved_ns: int = 0

    @property
    def fault(self) -> str:
        """What the drive reports."""
        return self.fault_text

    @property
    def enabled(self) -> bool:
        """Whether it follows commands."""
        return self.on

    def advance(self, now_ns: int) -> None:
        """The mechanics up to ``now_ns``: p' = (target - p) / lag."""
        elapsed_s, self._moved_ns = (now_ns - self._moved_ns) * 1e-9 if self._moved_ns else 0.0, now_ns
        if math.isnan(self.target_mm) or self.blocked or not elapsed_s:
            return
        share = 1.0 - math.exp(-elapsed_s / self.lag_s) if self.lag_s else 1.0
        self.position_mm += share * (self.target_mm - self.position_mm)

    def poll(self, now_ns: int) -> Sequence[AxisSample]:
        """What was asked for since the last call."""
        self.called("poll")
        if self.held_up:
            return []
        due = [self._due.popleft() for _ in range(min(len(self._due), AT_ONCE))]
        return [] if self.silent else [self._sample(captured_ns, now_ns, mm, mm_s) for captured_ns, mm, mm_s in due]

    def _sample(self, captured_ns: int, now_ns: int, mm: float, mm_s: float) -> AxisSample:
        self.next_seq += 1
        read_mm = mm if self.reads_mm is None else self.reads_mm
        return AxisSample(self.next_seq - 1, captured_ns, now_ns, read_mm, mm_s, 0.0, 0, int(self.valid))

    def command(self, position_mm: float, now_ns: int) -> None:
        """A set-point; the place and speed of this moment will be in the next poll."""
        self.called("command")
        self.commands.append((now_ns, position_mm))
        self._ask(now_ns)
        self.target_mm = position_mm * self.scale

    def request(self, now_ns: int) -> None:
        """A sample without a command."""
        self.called("request")
        self.requests.append(now_ns)
        self._ask(now_ns)

    def _ask(self, now_ns: int) -> None:
        self.advance(now_ns)
        stands = self.blocked or math.isnan(self.target_mm)
        away_mm = 0.0 if stands else self.target_mm - self.position_mm
        mm_s = away_mm / self.lag_s if self.lag_s else 0.0
        self._due.append((now_ns, self.position_mm, mm_s if self.velocity_mm_s is None else self.velocity_mm_s))

    def home(self) -> None:
        """Homing is instant; it ends at ``home_mm``."""
        self.called("home")
        self.referenced = True
        if not math.isnan(self.home_mm):
            self.position_mm = self.home_mm

    def move_to(self, position_mm: float, speed_mm_s: float) -> None:
        """A move of the drive's own is instant."""
        self.called("move_to")
        self.position_mm = self.target_mm = position_mm

    def enable(self) -> None:
        """Torque on at the present position."""
        self.called("enable")
        self.on, self.limp, self.target_mm = True, False, self.position_mm

    def quick_stop(self) -> None:
        """Stands at once; takes no commands until it is enabled."""
        self.called("quick_stop")
        if self.unstoppable:
            raise DeviceError(self.unstoppable)
        self.quick_stops.append(self.clock.now_ns)
        self.on, self.target_mm = False, self.position_mm

    def power_off(self) -> None:
        """Without torque: it stands, and ``limp`` says so."""
        self.called("power_off")
        self.on, self.limp, self.target_mm = False, True, math.nan

    def history(self) -> tuple[str, ...]:
        """What it remembers."""
        self.called("history")
        return self.remembered

    def reset_fault(self) -> None:
        """Clears the fault unless ``unclearable`` says why not."""
        self.called("reset_fault")
        if self.unclearable:
            raise DeviceError(self.unclearable)
        self.fault_text = ""


@dataclass
class FakeForce(FakeDevice):
    """A six-axis sensor over a spring, on the axis and with the sign that ``wiring`` names, unless told otherwise."""

    axis: FakeAxis = field(default_factory=lambda: FakeAxis(Clock(), 1))
    wiring: Wiring = field(default_factory=Wiring)
    surface_mm: float = SURFACE_MM
    stiffness_N_mm: float = STIFFNESS_N_MM
    zero_N: float = ZERO_N
    gain: float = 1.0
    extra_N: Callable[[int], float] = lambda _: 0.0
    sideways_N: Triple = (0.0, 0.0, 0.0)
    moment_N_m: Triple = (0.0, 0.0, 0.0)
    frozen: bool = False
    valid: bool = True
    latency_ns: int = 0
    silent_until_ns: int = 0
    samples: list[ForceSample] = field(default_factory=list)
    _due_ns: int = 0
    _held: deque[ForceSample] = field(default_factory=deque)

    @property
    def true_N(self) -> float:
        """What presses on the tissue now, whatever the sensor says."""
        return self.stiffness_N_mm * max(0.0, self.axis.position_mm - self.surface_mm)

    def poll(self, now_ns: int) -> Sequence[ForceSample]:
        """What has arrived: a sample is taken every period and arrives ``latency_ns`` later."""
        self.called("poll")
        self._due_ns = self._due_ns or now_ns
        while self._due_ns <= now_ns:
            if not self.silent and self._due_ns >= self.silent_until_ns:
                self._held.append(self._sample(self._due_ns))
            self._due_ns += self.period_ns
        arrived = []
        while self._held and self._held[0].capture_ns + self.latency_ns <= now_ns:
            arrived.append(self._held.popleft()._replace(arrival_ns=now_ns))
        self.samples += arrived
        return arrived

    def _sample(self, captured_ns: int) -> ForceSample:
        number = len(self.samples) + len(self._held)
        if self.frozen and self.samples:
            values = self.samples[-1][4:10]
        else:
            values = (*self._force(captured_ns, DITHER_N[number % 3]), *self.moment_N_m)
        self.next_seq += 1
        return ForceSample(self.next_seq - 1, captured_ns, captured_ns, 0, *values, math.nan, 0, int(self.valid))

    def _force(self, captured_ns: int, noise_N: float) -> Triple:
        config = self.wiring.force
        sign = 1.0 if config.compression == "positive" else -1.0
        compression_N = self.gain * (self.true_N + self.extra_N(captured_ns)) + self.zero_N + noise_N
        along = ("fx", "fy", "fz").index(config.axis)
        x_N, y_N, z_N = (other + sign * compression_N * (at == along) for at, other in enumerate(self.sideways_N))
        return x_N, y_N, z_N


TIP, ARM, DIRECTION = (35.0, -60.0, -1400.0), (95.0, -40.0, -1405.0), (0.0, 0.6, -0.8)
LOST = (math.nan, math.nan, math.nan)


@dataclass
class FakeTracker(FakeDevice):
    """A camera: tool 0 rides on the tip, tool 1 on the limb, which ``limb_mm`` displaces."""

    axis: FakeAxis = field(default_factory=lambda: FakeAxis(Clock(), 1))
    limb_mm: Triple = (0.0, 0.0, 0.0)
    scale: float = 1.0
    hidden: frozenset[int] = frozenset()
    latency_ns: int = 0
    tools: tuple[str, ...] = ("tip", "arm")
    frame: int = 0
    samples: list[MarkerSample] = field(default_factory=list)
    _due_ns: int = 0
    _held: deque[MarkerSample] = field(default_factory=deque)

    def poll(self, now_ns: int) -> Sequence[MarkerSample]:
        """One sample a tool and frame."""
        self.called("poll")
        self._due_ns = self._due_ns or now_ns
        while self._due_ns <= now_ns:
            if not self.silent:
                self._look()
            self._due_ns += self.period_ns
        arrived = []
        while self._held and self._held[0].capture_ns + self.latency_ns <= now_ns:
            arrived.append(self._held.popleft()._replace(arrival_ns=now_ns))
        self.samples += arrived
        return arrived

    def _look(self) -> None:
        mm = self.scale * self.axis.position_mm
        tip = [at + mm * along for at, along in zip(TIP, DIRECTION, strict=True)]
        arm = [at + moved for at, moved in zip(ARM, self.limb_mm, strict=True)]
        for tool, place in enumerate((tip, arm)):
            x_mm, y_mm, z_mm = LOST if tool in self.hidden else place
            self.next_seq += 1
            self._held.append(
                MarkerSample(self.next_seq - 1, self._due_ns, self._due_ns, self.frame, tool, x_mm, y_mm, z_mm,
                             1.0, 0.0, 0.0, 0.0, 0.1, int(tool not in self.hidden))
            )  # fmt: skip
        self.frame += 1
