"""A plug-in's driver as the loop holds it: whatever it does wrong is a DeviceError that names it, and stops motion.

Our own drivers are tested with this repository; one from elsewhere may raise anything, block, let its times run back or
give other units. The loop takes none of that on trust, and a plug-in that fails ends its device and not the loop.
"""

import math
import resource
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, Self, TypeVar

from drivers.input_role import Input
from drivers.kept import lack
from drivers.roles import Device, ForceSensor, Identity, LinkCounters, MarkerTracker, ServoAxis
from rig import plugins
from rig.channels import AxisSample, ForceSample, MarkerSample
from rig.config.products.roles import ForceProduct, Product
from rig.deadline import within
from rig.errors import DeviceError, RigError
from rig.input_streams import InputSample
from rig.plugins import Plugin

Made = TypeVar("Made", bound=Device)
Answer = TypeVar("Answer")
Sample = TypeVar("Sample", ForceSample, AxisSample, MarkerSample, InputSample)
# Twenty cycles of the loop; waiting for another thread of this interpreter takes 5 ms at most.
BLOCKED_NS = 20_000_000
# One may be a page that was put aside; three in a tenth of a second are a driver that waits.
BLOCKED_POLLS, AMONG_POLLS = 3, 100
# A converter's end lies a little beyond its range; newton for gram or millinewton is a factor of a hundred at least.
BEYOND_RANGE = 2.0
# The largest volume of a camera, and far beyond any axis.
FARTHEST_MM = 10_000.0
# Of the first fifty samples, as a mean rate takes: 2.5 s of a slow tracker, less than an approach. In bunches of three
# that are dated by their arrival two of three have the time of the one before; a busy computer makes a few alike.
ALIKE_AMONG, ALIKE_LARGEST = 50, 0.6
UNDATED = (
    "most of its samples have the time of the one before: date samples by their numbers (rig.timing.ClockMap), not by"
    " arrival"
)
# The loop is given up by its operators after a second without a cycle; who is at fault has to be named before that.
CYCLIC_S = 0.5
START_S = 30.0  # half of what the loop has for its start, homing included
RATE_TOLERANCE = 0.1  # half of what lies between neighbouring rates of a sensor


class Guarded(ABC, Generic[Made, Sample]):
    """What every role has. ``now`` is the monotonic clock, ``waits`` how often this thread has waited so far."""

    ROLE: str
    """As in `drivers.kept`, and in the name of the group of entry points."""
    KIND: type[Sample]

    @classmethod
    def guard(cls, config: Product, make: Callable[[], Made]) -> Self | Made:
        """What ``make`` gives, guarded where a plug-in declares it."""
        plugin = plugins.declaring(f"tissue_rig.{cls.ROLE}", config.product)
        return cls(plugin, config, make) if plugin else make()

    def __init__(
        self,
        plugin: Plugin,
        config: Product,
        make: Callable[[], Made],
        now: Callable[[], int] = time.monotonic_ns,
        waits: Callable[[], int] = lambda: resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw,
    ) -> None:
        self._plugin, self._config, self._now, self._waits = plugin, config, now, waits
        self._device = self._asked(make)
        self._last_ns: dict[int, tuple[int, int]] = {}
        self._alike: dict[int, list[bool]] = {}
        self._concern = ""
        self._blocked = deque[bool](maxlen=AMONG_POLLS)
        self._refuse_lacking(whole=False)

    def _refuse_lacking(self, whole: bool) -> None:
        if absent := lack(self._device, self.ROLE, whole):
            self.close()
            raise self._error(absent)

    @property
    def counters(self) -> LinkCounters:
        return self._device.counters

    @counters.setter
    def counters(self, counters: LinkCounters) -> None:
        self._device.counters = counters

    @property
    def next_seq(self) -> int:
        return self._device.next_seq

    @next_seq.setter
    def next_seq(self, seq: int) -> None:
        self._device.next_seq = seq

    @property
    def identity(self) -> Identity:
        return self._asked(lambda: self._device.identity)

    @property
    def period_ns(self) -> int:
        return self._asked(lambda: self._device.period_ns)

    def start(self) -> None:
        with within(START_S):
            self._asked(self._device.start)
        self._refuse_lacking(whole=True)
        self._refuse_rate()

    def _refuse_rate(self) -> None:
        """Later its samples are held against its own period alone."""
        promised_Hz, own_ns = self._asked(lambda: self._config.promised_Hz), self.period_ns
        own_Hz = 1e9 / own_ns if own_ns else 0.0
        if promised_Hz is not None and abs(own_Hz - promised_Hz) > RATE_TOLERANCE * promised_Hz:
            raise self._error(f"its driver has a rate of {own_Hz:.1f} Hz, its declaration one of {promised_Hz:.1f} Hz")

    def fileno(self) -> int:
        return self._asked(self._device.fileno)

    def close(self) -> None:
        """Never raises, whatever the plug-in does."""
        try:
            self._device.close()
        except (Exception, SystemExit):  # there is nobody left who could act on it
            return

    def _poll(self, poll: Callable[[int], Sequence[Sample]], now_ns: int) -> Sequence[Sample]:
        begun_ns, waits = self._now(), self._waits()
        samples = self._soon(lambda: poll(now_ns))
        self._note_wait(self._now() - begun_ns, self._waits() - waits)
        checked = self._asked(lambda: self._checked(samples))
        if self._concern:
            self.counters.trouble = self.counters.trouble or self._concern
        return checked

    def _checked(self, samples: Sequence[Sample]) -> Sequence[Sample]:
        wrong = next(filter(None, map(self._wrong, samples)), "")
        if wrong:
            raise self._error(wrong)
        return samples

    def _note_wait(self, took_ns: int, waits: int) -> None:
        """Who is merely interrupted does not wait of its own accord."""
        self._blocked.append(took_ns > BLOCKED_NS and waits > 0)
        if sum(self._blocked) >= BLOCKED_POLLS:
            raise self._error(
                f"its poll blocks, for {took_ns * 1e-6:.0f} ms just now (limit {BLOCKED_NS * 1e-6:g} ms);"
                " what waits belongs into a ThreadedSource"
            )

    def _wrong(self, sample: Sample) -> str:
        if not isinstance(sample, self.KIND):
            return f"it gives {sample!r}, where a {self.KIND.__name__} is expected"
        stream = sample.tool if isinstance(sample, MarkerSample) else 0
        last_ns, came_ns = self._last_ns.get(stream, (sample.capture_ns, -1))
        back_ns = last_ns - sample.capture_ns
        if back_ns > 0:
            return f"its times run back by {back_ns * 1e-6:.3f} ms at sample {sample.seq}"
        if sample.capture_ns > sample.arrival_ns:
            return (
                f"sample {sample.seq} was taken {(sample.capture_ns - sample.arrival_ns) * 1e-6:.3f} ms after it came"
            )
        self._judge_dates(stream, (back_ns, sample.arrival_ns) == (0, came_ns))
        self._last_ns[stream] = sample.capture_ns, sample.arrival_ns
        return self._impossible(sample) if sample.valid else ""

    def _judge_dates(self, stream: int, alike: bool) -> None:
        """Once, and nothing is lost by it. What comes one by one with one time has a coarse clock, and a true one."""
        looked = self._alike.setdefault(stream, [])
        if len(looked) < ALIKE_AMONG:
            looked.append(alike)
            if sum(looked) > ALIKE_LARGEST * ALIKE_AMONG and self.period_ns > 0:  # what has no rate may come together
                self._concern = UNDATED

    @abstractmethod
    def _impossible(self, sample: Sample) -> str:
        """What of a valid sample cannot be; "" where all can."""

    def _soon(self, ask: Callable[[], Answer]) -> Answer:
        """As ``_asked`` for what the loop calls in each cycle: what never comes back is named, and not waited for."""

        def asked() -> Answer:
            with within(CYCLIC_S):
                return ask()

        return self._asked(asked)

    def _asked(self, ask: Callable[[], Answer]) -> Answer:
        try:
            return ask()
        except RigError:
            raise
        except (Exception, SystemExit) as error:  # named, and no more than this device is lost by it
            raise self._error(f"{type(error).__name__}: {error}") from error

    def _error(self, what: str) -> DeviceError:
        whose = self._plugin
        return DeviceError(
            f"{whose.declares}, a plug-in of {whose.distribution} {whose.version}: {what}; see its maker"
        )


class GuardedForce(Guarded[ForceSensor, ForceSample]):
    """A force sensor."""

    ROLE, KIND = "force", ForceSample

    def poll(self, now_ns: int) -> Sequence[ForceSample]:
        """Samples since the last call, each looked at."""
        return self._poll(self._device.poll, now_ns)

    def _impossible(self, sample: ForceSample) -> str:
        assert isinstance(self._config, ForceProduct)
        largest_N = max((abs(value) for value in sample[4:7] if not math.isnan(value)), default=0.0)
        fits = largest_N <= BEYOND_RANGE * self._config.range_N
        return "" if fits else f"{largest_N:g} N from a sensor of {self._config.range_N:g} N: wrong unit?"


class GuardedTracker(Guarded[MarkerTracker, MarkerSample]):
    """A marker tracker."""

    ROLE, KIND = "tracker", MarkerSample

    @property
    def tools(self) -> tuple[str, ...]:
        return self._asked(lambda: self._device.tools)

    def poll(self, now_ns: int) -> Sequence[MarkerSample]:
        """Samples since the last call, each looked at."""
        return self._poll(self._device.poll, now_ns)

    def _impossible(self, sample: MarkerSample) -> str:
        far_mm = math.hypot(sample.x_mm, sample.y_mm, sample.z_mm)
        return "" if far_mm <= FARTHEST_MM else f"a marker {far_mm:g} mm away: wrong unit?"


class GuardedInput(Guarded[Input, InputSample]):
    """An input, which may wait, as it has a thread of its own."""

    ROLE, KIND = "input", InputSample

    def poll(self, now_ns: int) -> Sequence[InputSample]:
        """Samples since the last call, each looked at."""
        return self._asked(lambda: self._checked(self._device.poll(now_ns)))

    def concern(self) -> str:
        return self._asked(self._device.concern) or self._concern

    def _impossible(self, sample: InputSample) -> str:  # noqa: ARG002 - nothing is known of what it measures
        return ""


class GuardedAxis(Guarded[ServoAxis, AxisSample]):
    """A servo axis."""

    ROLE, KIND = "axis", AxisSample
    _failure: DeviceError | None = None

    def _said(self, ask: Callable[[], Answer], unsaid: Answer) -> Answer:
        """What the loop looks at anywhere in its cycle: a failure is a fault, and then raised by ``poll``."""
        try:
            return unsaid if self._failure else self._soon(ask)
        except DeviceError as error:
            self._failure = error
            return unsaid

    @property
    def fault(self) -> str:
        return self._said(lambda: self._device.fault, "") or str(self._failure or "")

    @property
    def enabled(self) -> bool:
        return self._said(lambda: self._device.enabled, False)

    @property
    def referenced(self) -> bool:
        return self._said(lambda: self._device.referenced, False)

    def home(self) -> None:
        self._asked(self._device.home)

    def move_to(self, position_mm: float, speed_mm_s: float) -> None:
        self._asked(lambda: self._device.move_to(position_mm, speed_mm_s))

    def enable(self) -> None:
        self._asked(self._device.enable)

    def poll(self, now_ns: int) -> Sequence[AxisSample]:
        """Samples since the last call, each looked at."""
        if self._failure:
            raise self._failure
        return self._poll(self._device.poll, now_ns)

    def command(self, position_mm: float, now_ns: int) -> None:
        self._soon(lambda: self._device.command(position_mm, now_ns))

    def request(self, now_ns: int) -> None:
        self._soon(lambda: self._device.request(now_ns))

    def quick_stop(self) -> None:
        self._soon(self._device.quick_stop)

    def power_off(self) -> None:
        self._soon(self._device.power_off)

    def history(self) -> tuple[str, ...]:
        return self._asked(self._device.history)

    def reset_fault(self) -> None:
        self._asked(self._device.reset_fault)

    def _impossible(self, sample: AxisSample) -> str:
        far_mm = abs(sample.position_mm)
        return "" if far_mm <= FARTHEST_MM else f"position {sample.position_mm:g} mm: wrong unit?"
