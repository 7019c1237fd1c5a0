"""A Zaber axis in the role of servo axis, by bounded moves: it has no cyclic mode and no watch over its host.

``command`` keeps the newest set-point; at ``axis.rate_Hz`` one write tells the axis where that will be and asks where
the axis is. Each move ends by itself (see ``following``), so an axis whose host died stands within 40 ms and stays
there, with torque: it neither retracts nor goes on.
"""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from drivers.epos4.cia402 import STATE_WORDS, PdsState, Statusword
from drivers.epos4.walker import never
from drivers.ports import Port, open_port
from drivers.roles import Identity, LinkCounters
from drivers.sampled import SampledDevice, allowed_mm
from drivers.zaber import flags, setup
from drivers.zaber.codec import Scale, ZaberReply
from drivers.zaber.dialogue import AsciiDialogue
from drivers.zaber.following import BoundedMove, Follower
from drivers.zaber.samples import PositionSamples
from rig.channels import AxisSample
from rig.config.products.zaber_ascii import BITS, ZaberWiring
from rig.config.wiring import Limits
from rig.errors import DeviceError, RigError, SafetyStop

LOST_AFTER_NS = 500_000_000  # fifty replies of the usual rate
MOST_OUTSTANDING = 3  # more, and what is told would be older than the move that it ends in
ARRIVED_MM = 0.02  # where a move ends: some microsteps of the coarsest screw
# A move of its own is led by set-points too, so that it ends by itself where the host dies; this long at most in one.
LEG_S = 0.25
REACTION_S = 1.0  # to begin and end what takes no way


class ZaberAxis(SampledDevice):
    """ServoAxis on one Zaber axis; nothing is opened before ``start``."""

    _samples: PositionSamples

    def __init__(
        self,
        open_port: Callable[[], Port],
        config: ZaberWiring,
        limits: Limits,
        rate_Hz: float = 1000.0,
        interrupted: Callable[[], bool] = never,
        now: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.counters = LinkCounters()
        self._open_port, self._config, self._limits = open_port, config, limits
        self._interrupted, self._now, self._sleep = interrupted, now, sleep
        self._name = f"servo axis on {config.port}, device {config.device}"
        self._scale = Scale(config.increments_per_mm, config.direction)
        self.period_ns = round(1e9 / min(rate_Hz, config.rate_Hz))
        span = limits.position_min_mm, limits.position_max_mm
        self._follower = Follower(self.period_ns * 1e-9, config.lag_ms * 1e-3, *span, limits.speed_mm_s)
        self._samples = PositionSamples(self._scale)
        self._identity = Identity("", "", "")
        self._dialogue: AsciiDialogue | None = None
        self._following = self._stopping = self._referenced = False
        self._flag, self._refused, self._busy = flags.NONE, "", False
        self._moved, self._due_ns, self._heard_ns, self._unanswered_ns = -1, 0, 0, 0

    @property
    def fault(self) -> str:
        """The flag in words, or why it refused what it was told; empty if nothing."""
        if flags.is_fault(self._flag):
            return flags.described(self._flag)
        if self._following and not self._referenced:
            return "it lost its reference, as after a restart"
        return self._refused

    @property
    def enabled(self) -> bool:
        """Whether the axis follows set-points now."""
        return self._following and not self.fault

    @property
    def referenced(self) -> bool:
        """Whether positions count from home, as the device last said."""
        return self._referenced

    def fileno(self) -> int:
        """Descriptor of the line; raises DeviceError before ``start``."""
        return self._started().port.fileno()

    def start(self) -> None:
        """Identifies the axis, stops it, and writes the limits that it keeps by itself."""
        self.close()
        self._dialogue = dialogue = self._talk(self._open_port())
        try:
            self._identity = setup.identify(dialogue, self._config)
            self._halt(dialogue)
            setup.configure(dialogue, self._config, self._limits)
            self._look(dialogue)
        except BaseException:
            self.close()
            raise
        self._samples = PositionSamples(self._scale, self._samples.next_seq)
        self._following = self._stopping = False
        self._refused, self._due_ns, self._heard_ns = "", 0, self._now()

    def identify(self) -> Identity:
        """Who is there; no setting is written, since they outlive the power."""
        with contextlib.closing(self._open_port()) as port:
            return setup.identify(self._talk(port), self._config)

    def _talk(self, port: Port) -> AsciiDialogue:
        device, axis = self._config.device, self._config.axis_number
        return AsciiDialogue(port, device, axis, self._name, self.counters, self._now, self._sleep)

    def home(self) -> None:
        """Finds the reference by the device's own search; raises DeviceError where it does not within the travel."""
        dialogue = self._started()
        travel_mm = self._limits.position_max_mm - self._limits.position_min_mm
        limit_s = 2 * travel_mm / self._config.homing_speed_mm_s + REACTION_S
        with self._moving(dialogue):
            dialogue.ask("home", tries=1)
            dialogue.wait_idle(limit_s, "homing", self._interrupted)
            self._look(dialogue)
            if not self._referenced or self.fault:
                raise DeviceError(f"{self._name}: homing found no reference ({self.fault or 'no fault'}); look at it")

    def move_to(self, position_mm: float, speed_mm_s: float) -> None:
        """Moves in legs that end by themselves, waits; raises SafetyStop beyond a limit, else DeviceError."""
        dialogue = self._started()
        self._check_referenced("moving")
        target_mm = allowed_mm(position_mm, self._limits, self._name)
        if not 0 < speed_mm_s <= self._limits.speed_mm_s:
            raise SafetyStop(
                f"{self._name}: refused to move at {speed_mm_s:g} mm/s; limits.speed_mm_s is"
                f" {self._limits.speed_mm_s:g} mm/s"
            )
        with self._moving(dialogue):
            self._go(dialogue, target_mm, speed_mm_s)

    def enable(self) -> None:
        """Follows set-points from now on, from the present position."""
        dialogue = self._started()
        self._check_referenced("enabling")
        with self._moving(dialogue):
            allowed_mm(self._place_mm(dialogue), self._limits, self._name)
            self._look(dialogue)
        if self.fault:
            raise DeviceError(f"{self._name}: cannot be enabled: {self.fault}; remove its cause, then reset it")
        self._follower.begin()
        self._following, self._stopping, self._heard_ns = True, False, self._now()

    def poll(self, now_ns: int) -> Sequence[AxisSample]:
        """Samples since the last call; raises DeviceError where nothing is answered for half a second."""
        dialogue = self._started()
        samples = [self._take(reply, now_ns) for reply in dialogue.heard(dialogue.port.read())]
        if self._unanswered_ns and now_ns - max(self._heard_ns, self._unanswered_ns) > LOST_AFTER_NS:
            raise DeviceError(f"{self._name}: no reply for {LOST_AFTER_NS / 1e9:g} s; check its power and the cable")
        self.counters.device_lost = self._samples.lost
        return [sample for sample in samples if sample]

    def command(self, position_mm: float, now_ns: int) -> None:
        """The newest set-point, sent when the next move is due; raises SafetyStop beyond the limits."""
        setpoint_mm = allowed_mm(position_mm, self._limits, self._name)
        if not self._is_due(now_ns):
            return
        place = self._samples.place
        if place is None or not self._following:
            self._send(now_ns, "")
        else:
            self._send(now_ns, _text(self._follower.move(setpoint_mm, now_ns * 1e-9, place), self._scale))

    def request(self, now_ns: int) -> None:
        """Asks for one sample; a stop that was not yet obeyed is said again."""
        if self._is_due(now_ns):
            self._send(now_ns, "stop" if self._stopping and self._busy else "")

    def quick_stop(self) -> None:
        """Brakes by the device's ramp and stays where it stands, with torque, until ``enable``; does not wait."""
        self._following, self._stopping, self._busy = False, True, True
        self._send(self._now(), "stop")

    def power_off(self) -> None:
        """Without torque, until ``enable``; does not wait."""
        self._following, self._stopping = False, False
        self._send(self._now(), "driver disable")

    def history(self) -> tuple[str, ...]:
        """The flags that are up, in words: the device remembers no others."""
        return tuple(flags.described(flag) for flag in self._flags(self._started()))

    def reset_fault(self) -> None:
        """Clears the flags; raises DeviceError where one is still there."""
        dialogue = self._started()
        dialogue.ask("warnings clear")
        self._refused = ""
        self._look(dialogue)
        if flags.is_fault(self._flag) and self._flag not in flags.POWERLESS:
            raise DeviceError(f"{self._name}: the fault is still there: {self.fault}; remove its cause first")

    def close(self) -> None:
        """Stops, and gives the port back; the axis keeps its torque. Never raises."""
        dialogue, self._dialogue = self._dialogue, None
        self._following = False
        if dialogue:
            with contextlib.suppress(RigError):
                dialogue.ask("stop", tries=1)
            dialogue.port.close()

    def _started(self) -> AsciiDialogue:
        if self._dialogue is None:
            raise DeviceError(f"{self._name}: is not started or was closed; start it first")
        return self._dialogue

    def _is_due(self, now_ns: int) -> bool:
        if now_ns < self._due_ns or self._samples.outstanding(now_ns) >= MOST_OUTSTANDING:
            return False
        self._due_ns = max(self._due_ns + self.period_ns, now_ns)
        return True

    def _send(self, now_ns: int, order: str) -> None:
        """``order``, if any, and the question where the axis is, in one write."""
        dialogue, wire = self._started(), b""
        if order:
            self._moved, wire = dialogue.sent(order)
        number, question = dialogue.sent(f"get {self._config.position}")
        dialogue.port.write(wire + question)
        on_line_ns = 0 if dialogue.port.address.startswith("tcp://") else len(wire + question) * self._character_ns
        self._samples.asked(number, now_ns + on_line_ns)
        self._unanswered_ns = self._unanswered_ns or now_ns

    @property
    def _character_ns(self) -> int:
        return BITS * 1_000_000_000 // self._config.baud

    def _take(self, reply: ZaberReply, now_ns: int) -> AxisSample | None:
        self._heard_ns, self._unanswered_ns = now_ns, 0
        self._note(reply)
        if reply.number == self._moved and not reply.accepted and self._following:
            self._refused = f"it refused a set-point: {flags.reason(reply.data)}"
        return self._samples.take(reply, now_ns, self._status, not flags.is_fault(self._flag))

    def _note(self, reply: ZaberReply) -> None:
        self._flag, self._busy = reply.flag, reply.busy
        if reply.flag in flags.WITHOUT_REFERENCE:
            self._referenced = False
        elif not reply.flag.startswith(("F", "W")):  # what ranks higher would hide it
            self._referenced = True

    @property
    def _status(self) -> int:
        """As a CiA 402 drive would say it."""
        if flags.is_fault(self._flag):
            state = PdsState.SWITCH_ON_DISABLED if self._flag in flags.POWERLESS else PdsState.FAULT
        else:
            state = PdsState.ENABLED if self._following else PdsState.QUICK_STOP
        referenced = Statusword.REFERENCED if self._referenced else 0
        return int(STATE_WORDS[state] | referenced | (0 if self._busy else Statusword.TARGET_REACHED))

    def _look(self, dialogue: AsciiDialogue) -> None:
        """Takes down the flags that are up now."""
        up = self._flags(dialogue)
        self._referenced = not set(up) & set(flags.WITHOUT_REFERENCE)
        self._flag = next((flag for flag in up if flags.is_fault(flag)), flags.NONE)

    def _flags(self, dialogue: AsciiDialogue) -> tuple[str, ...]:
        """Those that are up; whatever was asked before is answered before, and waited for by nobody."""
        self._unanswered_ns = 0
        return dialogue.flags()

    def _place_mm(self, dialogue: AsciiDialogue) -> float:
        return self._scale.mm(float(dialogue.value(self._config.position)))

    def _halt(self, dialogue: AsciiDialogue) -> None:
        dialogue.ask("stop")
        dialogue.wait_idle(REACTION_S + self._limits.speed_mm_s / self._config.acceleration_mm_s2, "a stop", never)

    def _go(self, dialogue: AsciiDialogue, target_mm: float, speed_mm_s: float) -> None:
        """Leg by leg, each ``LEG_S`` long and begun before the last one ends."""
        place_mm = self._place_mm(dialogue)
        travel_s = abs(target_mm - place_mm) / speed_mm_s + 2 * speed_mm_s / self._config.acceleration_mm_s2
        deadline_ns = self._now() + round((travel_s + REACTION_S) * 1e9)
        while abs(target_mm - place_mm) > ARRIVED_MM:
            if self._interrupted():
                raise SafetyStop(f"{self._name}: stopped on request while it was moved")
            if self._now() > deadline_ns or self.fault:
                why = self.fault or f"within {travel_s + REACTION_S:.1f} s"
                raise DeviceError(f"{self._name}: {target_mm:g} mm was not reached: {why}; see what hinders the axis")
            leg_mm = min(abs(target_mm - place_mm), speed_mm_s * LEG_S)
            toward_mm = place_mm + leg_mm * (1 if target_mm > place_mm else -1)
            self._note(dialogue.ask(_text(BoundedMove(toward_mm, speed_mm_s), self._scale)))
            place_mm = self._place_mm(dialogue)
        dialogue.wait_idle(REACTION_S, "a move", self._interrupted)

    def _check_referenced(self, what: str) -> None:
        self._look(self._started())
        if not self._referenced:
            raise DeviceError(f"{self._name}: has no reference, and {what} needs one; home the axis first")

    @contextlib.contextmanager
    def _moving(self, dialogue: AsciiDialogue) -> Iterator[None]:
        """With torque; whatever goes wrong here stops the axis."""
        self._following = self._stopping = False
        self._refused = ""
        try:
            if set(self._flags(dialogue)) & set(flags.POWERLESS):
                dialogue.ask("driver enable")
            yield
        except BaseException:
            with contextlib.suppress(RigError):
                self.quick_stop()
            raise


def _text(move: BoundedMove, scale: Scale) -> str:
    return f"move abs {scale.steps(move.target_mm)} {scale.speed(move.speed_mm_s)}"


def open_axis(
    config: ZaberWiring, limits: Limits, rate_Hz: float = 1000.0, interrupted: Callable[[], bool] = never
) -> ZaberAxis:
    """The axis at the configured port, which ``start`` opens."""
    return ZaberAxis(partial(open_port, config.port, config.baud), config, limits, rate_Hz, interrupted)
