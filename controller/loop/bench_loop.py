"""One turn of the loop: poll inputs, decide, command, publish. Nothing in it waits."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Protocol, TypeVar

from controller.devices import takeover
from controller.devices.connections import Connections
from controller.devices.drivers import Devices, openers
from controller.devices.health import Standstill
from controller.devices.reopening import Openers
from controller.devices.states import DeviceStatus
from controller.devices.wire_damage import WireDamage
from controller.loop.executive import Cycle
from controller.loop.messages import Finished, Outcome, Status, StatusSaid, Stopped
from controller.loop.modes import AT_REST, PRESSING, Mode
from controller.loop.paired_samples import Touch
from controller.loop.phase_lock import PhaseLock
from controller.loop.registration import Point, Registration
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.state_machine import MotionStateMachine
from controller.loop.steps import Program
from controller.safety.first_touch import FirstTouch
from controller.safety.giving_way import give_way
from controller.safety.inputs import SafetyInputs
from controller.safety.load import LoadMonitor, calibrated_zero
from controller.safety.lost_contact import LostContact
from controller.safety.oscillation import OscillationMonitor
from controller.safety.table import TABLE, Action, Check, Incident
from rig.channel import Channel
from rig.channels import (
    AXIS,
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

STATUS_EVERY_S = 0.05
TEXT_BYTES = 160
Polled = TypeVar("Polled")
TIP, ARM = 0, 1
TOUCHING = (Mode.APPROACH, Mode.COMPRESS, Mode.CONTACT)
# A sample this many periods old is not acted on; when it counts as lost is for the safety table to say.
LATE_PERIODS = 5


class Ring(Protocol):
    """Where rows go."""

    def put(self, stream_id: int, body: bytes) -> None:
        """Publishes one row."""

    @property
    def fill(self) -> float:
        """Share of the ring not yet read."""

    def reader_age_ns(self, now_ns: int) -> int:
        """Since the reader's last sign of life."""


class BenchLoop:
    """Owns devices, state and machine; ``cycle`` is called once a cycle and returns False when it is time to go."""

    def __init__(
        self,
        wiring: Wiring,
        devices: Devices,
        ring: Ring,
        channel: Channel,
        commands: "Commands",
        now: Callable[[], int],
        table: tuple[Check, ...] = TABLE,
        opens: Openers | None = None,
        held: str = "",
    ) -> None:
        """``held``: why a person is to look first; until that is acknowledged nothing starts."""
        self.wiring, self.devices, self._ring, self._channel, self.now = wiring, devices, ring, channel, now
        self._commands = commands
        self.phase = PhaseLock(round(1e9 / wiring.loop.rate_Hz), devices.force.period_ns)
        period_s = self.phase.period_ns * 1e-9
        self.state = LoopState(
            dt_s=period_s,
            acceleration_mm_s2=wiring.axis.acceleration_mm_s2,
            position_min_mm=wiring.limits.position_min_mm,
            round_tip=wiring.tip.round,
        )
        self.machine = MotionStateMachine(wiring, self.state, self._finished, table)
        self.inputs = SafetyInputs()
        self._registration = Registration(devices.axis.period_ns)
        self._standstill, self._wire_damage = Standstill(), WireDamage()
        self.health = {
            stream: takeover.unheard(self.wiring, self.devices, stream) for stream in ("force", "axis", "marker")
        }
        self.published = {"force": -1, "axis": -1, "tracker": -1}
        said = partial(takeover.record_state_change, self)
        self.connections = Connections(devices.by_role(), opens or openers(wiring), said, now())
        self._status_every = round(STATUS_EVERY_S / period_s)
        self._cycles = self._events = self._program = 0
        self._load_monitor = LoadMonitor(devices.force.period_ns)
        self._first_touch, self._oscillation = FirstTouch(wiring), OscillationMonitor()
        self._lost_contact = LostContact()
        self._calibrated_zero = calibrated_zero(wiring)
        self._force_map = wiring.force_map
        self.braked = False
        self.input_statuses: dict[str, DeviceStatus] = {}
        self._touch_said: Touch | None = None
        self._limb_seen_ns = self._next_ns = 0
        if held:
            self.machine.hold(Incident(Action.IMMEDIATE, "recovery", held))

    def forget(self, stream: str) -> None:
        """What a device said before it was lost counts no more."""
        self.health[stream] = takeover.unheard(self.wiring, self.devices, stream)
        if stream == "force":
            self._load_monitor = LoadMonitor(self.devices.force.period_ns)
        elif stream == "marker":
            self._registration.begin()
            self._limb_seen_ns = 0
        else:
            self._standstill.begin()

    def run_cycle(self, cycle: Cycle) -> bool:
        """One turn, on what ``prepare`` and ``take_force`` took before."""
        now_ns = cycle.began_ns
        self.inputs.requests = self._commands.collect(self)
        self._look(now_ns, cycle)
        resting = self.machine.mode in AT_REST
        incident = self.machine.update(self.inputs)
        if incident:
            self._report(incident, now_ns)
            if resting and self.machine.mode is Mode.RETRACT:
                self._give_way(now_ns)
        self._say_touch(now_ns)
        # The drive samples when it is asked, which is later than this turn began.
        self._command(self.now())
        self._commands.confirm(self)
        self._publish(cycle, now_ns)
        self._cycles += 1
        return self._commands.more(self)

    def catch_up(self, now_ns: int) -> None:
        """Takes what the tracker said since the last turn."""
        if self.devices.tracker:
            for marker in self._polled("marker", self.devices.tracker.poll, now_ns):
                self._take_marker(marker)

    def prepare(self, now_ns: int) -> None:
        """Takes what the axis said since the last turn: before the force, which is placed by where it was."""
        for sample in self._polled("axis", self.devices.axis.poll, now_ns):
            self._take_axis(sample)

    def take_force(self, now_ns: int) -> None:
        """Takes what the force sensor said."""
        for sample in self._polled("force", self.devices.force.poll, now_ns):
            self._take_force(sample)

    def _polled(self, stream: str, poll: Callable[[int], Sequence[Polled]], now_ns: int) -> Sequence[Polled]:
        """What a device brought; nothing where it is lost."""
        try:
            return () if getattr(self.inputs, f"{stream}_lost") else poll(now_ns)
        except DeviceError as error:
            setattr(self.inputs, f"{stream}_lost", str(error))
            return ()

    def _take_force(self, sample: ForceSample) -> None:
        self._ring.put(FORCE.id, FORCE.pack(sample))
        self.published["force"] = sample.seq
        self.phase.observe(sample.capture_ns, sample.arrival_ns)
        self.state.raw_N = self._force_map.compression_N(sample.fx_N, sample.fy_N, sample.fz_N)
        self.state.wrench = self._force_map.wrench(sample[4:10])
        self.state.force_samples += 1
        self._load_monitor.force(sample.capture_ns, self.state.wrench)
        if sample.valid:
            self.state.paired.force(sample.capture_ns, self.state.raw_N)
        self.health["force"].update(sample.capture_ns, bool(sample.valid), sample[4:10])

    def _take_axis(self, sample: AxisSample) -> None:
        self._ring.put(AXIS.id, AXIS.pack(sample))
        state = self.state
        if math.isnan(state.position_mm):  # until the axis has said where it is, it is not told where to be
            state.setpoint = Setpoint(sample.position_mm, 0.0)
        self.published["axis"] = sample.seq
        state.position_mm, state.velocity_mm_s = sample.position_mm, sample.velocity_mm_s
        if sample.valid:
            state.paired.axis(sample.capture_ns, sample.position_mm)
        state.standstill_mm = self._standstill.update(sample.capture_ns, sample.position_mm)
        self._load_monitor.axis(sample.capture_ns, sample.position_mm)
        if self.devices.tracker:
            self._registration.axis(sample.capture_ns, sample.position_mm)
        self.health["axis"].update(sample.capture_ns, bool(sample.valid))

    def _take_marker(self, sample: MarkerSample) -> None:
        self._ring.put(MARKER.id, MARKER.pack(sample))
        self.published["tracker"] = sample.seq
        if sample.tool == TIP:
            self.health["marker"].update(sample.capture_ns, bool(sample.valid))
        at = Point(sample.x_mm, sample.y_mm, sample.z_mm)
        if sample.valid and all(map(math.isfinite, at)):
            if sample.tool == TIP:
                self._registration.tip(sample.frame, sample.capture_ns, at)
            elif sample.tool == ARM:
                self._limb_seen_ns = sample.capture_ns
                self._registration.arm(sample.frame, at)
        self.state.patient_mm, self.state.axis_scale = self._registration.moved_mm, self._registration.scale

    def _look(self, now_ns: int, cycle: Cycle) -> None:
        state, inputs, health = self.state, self.inputs, self.health
        state.now_ns = now_ns
        state.force_N = state.raw_N - state.zero_N
        going = state.setpoint if self.machine.busy else Setpoint(state.position_mm, 0.0)
        state.load = self._load_monitor.load(
            now_ns, state.reference_zero or self._calibrated_zero, state.noise_N, going, state.acceleration_mm_s2
        )
        state.force_late = health["force"].age_ns(now_ns) > LATE_PERIODS * health["force"].period_ns
        state.following_mm = state.setpoint.position_mm - state.position_mm if self.machine.busy else 0.0
        inputs.touch_wrong = self._first_touch.update(state) if self.machine.mode in TOUCHING else ""
        inputs.contact_lost = self._lost_contact.update(state) if self.machine.mode in PRESSING else ""
        inputs.oscillation = self._oscillation.update(state) if self.machine.mode is Mode.CONTACT else ""
        inputs.force_valid, inputs.force_frozen = health["force"].valid, health["force"].frozen
        inputs.force_age_ms = health["force"].age_ns(now_ns) * 1e-6
        inputs.axis_age_ms = health["axis"].age_ns(now_ns) * 1e-6
        inputs.marker_age_ms = health["marker"].age_ns(now_ns) * 1e-6
        # Only a marker that was there can be lost: not every bench has one on the limb.
        inputs.limb_age_ms = (now_ns - self._limb_seen_ns) * 1e-6 if self._limb_seen_ns else 0.0
        inputs.drive_fault = self.devices.axis.fault
        # Against the cycle before, as a loop that was held up inside one skips what it missed and is on time again.
        inputs.late_ms = (cycle.began_ns - (self._next_ns or cycle.scheduled_ns)) * 1e-6
        self._next_ns = cycle.scheduled_ns + self.phase.period_ns
        inputs.recorder_fill = self._ring.fill
        inputs.recorder_silent_s = self._ring.reader_age_ns(now_ns) * 1e-9
        inputs.supervisor_lost = self._channel.lost
        inputs.stop_silent_s = self._commands.stop_silent_s(now_ns)
        inputs.operator_silent_s = (now_ns - self._commands.heard_ns) * 1e-9 if self._commands.heard_ns else 0.0

    def _command(self, now_ns: int) -> None:
        if self.inputs.axis_lost:
            return
        try:
            if self.devices.axis.enabled and not self.braked and math.isfinite(self.state.position_mm):
                self._standstill.sent(now_ns, self.state.setpoint.position_mm)
                self.devices.axis.command(self.state.setpoint.position_mm, now_ns)
            else:
                self.devices.axis.request(now_ns)
        except DeviceError as error:
            self.inputs.axis_lost = str(error)

    def _report(self, incident: Incident, now_ns: int) -> None:
        self.event(incident.action, incident.code, incident.text, now_ns)
        self._channel.send(Stopped(code=incident.code, text=incident.text, action=incident.action.name))
        if incident.action is Action.IMMEDIATE and not self.inputs.axis_lost:
            self.braked = True
            try:
                self.devices.axis.quick_stop()
            except DeviceError as error:
                self.inputs.axis_lost = str(error)

    def _give_way(self, now_ns: int) -> None:
        """The machine retreats from a limb that pushes; here the drive is made to follow it, or loses its power."""
        self._standstill.begin()
        try:
            self.braked = not give_way(self.devices.axis, self.wiring.limits)
        except DeviceError as error:
            self.braked = True
            self.event(Action.WARNING, "no_way", str(error), now_ns)
        if self.braked:
            self.machine.stay()

    def start(self, program: Program, number: int) -> None:
        """Begins a program, whose outcome will carry ``number``; where the limb is now is where it should stay."""
        self._program = number
        self._wire_damage.begin(self.devices.by_role())
        self._registration.begin()
        self._standstill.begin()
        self._first_touch.begin()
        self._lost_contact.begin()
        self.state.standstill_mm, self.state.axis_scale = 0.0, None
        self.machine.start(program)

    def release(self) -> None:
        """After a reset: the axis is enabled anew at its present position and takes commands again."""
        if self.braked or not self.devices.axis.enabled:
            self.devices.axis.reset_fault()
            self.devices.axis.enable()
        self.braked = False
        self.machine.acknowledge()

    def close(self) -> None:
        """Leaves the devices there are now safe; they may not be those it began with."""
        self.connections.close()
        self.devices.close()

    def event(self, level: int, code: str, text: str, now_ns: int) -> None:
        """One row of the event stream; the text is cut to what a ring cycle takes."""
        short = text.encode()[:TEXT_BYTES].decode(errors="ignore")
        row = EventSample(self._events, now_ns, now_ns, int(level), code[:20], short)
        self._ring.put(EVENT.id, EVENT.pack(row))
        self._events += 1

    def _say_touch(self, now_ns: int) -> None:
        """One note for each surface found."""
        touch = self.state.touch
        if touch is not None and touch is not self._touch_said:
            self.event(Action.NOTE, "contact", touch.sentence, now_ns)
        self._touch_said = touch

    def _finished(self, outcome: str, incident: Incident | None) -> None:
        state = self.state
        self.event(Action.NOTE, "program_end", outcome, state.now_ns)
        outcome_of = Outcome(
            outcome=outcome,
            cause=incident.text if incident else "",
            peak_force_N=state.peak_force_N,
            surface_mm=None if math.isnan(state.surface_mm) else state.surface_mm,
            zero_N=None if math.isnan(state.zero_N) else state.zero_N,
            touch=state.touch,
            wire_damage=self._wire_damage.shares(self.devices.by_role()),
            carried=state.carried,
        )
        self._channel.send(Finished(program=self._program, outcome=outcome_of))

    def _publish(self, cycle: Cycle, now_ns: int) -> None:
        state, health, machine = self.state, self.health, self.machine
        bits = health["force"].bits(now_ns) | health["axis"].bits(now_ns) << 3 | health["marker"].bits(now_ns) << 6
        row = LoopSample(
            self._cycles, now_ns, now_ns, cycle.number, cycle.missed, cycle.scheduled_ns,
            cycle.wake_ns - cycle.scheduled_ns, self.now() - cycle.began_ns + cycle.prepared_ns,
            health["force"].age_ns(now_ns), health["axis"].age_ns(now_ns), health["marker"].age_ns(now_ns), bits,
            machine.mode, machine.step_index, state.force_N, state.reference_N, state.position_mm,
            state.setpoint.position_mm, state.surface_mm, state.depth_mm, state.tangent_N_mm,
        )  # fmt: skip
        self._ring.put(LOOP.id, LOOP.pack(row))
        if self._cycles % self._status_every == 0:
            takeover.attend(self, now_ns)
            self._channel.send_newest(StatusSaid(status=self._status(row)))
        else:
            self._channel.flush()

    def _status(self, row: LoopSample) -> Status:
        latched, inputs = self.machine.latched, self.inputs
        lost = {"force": inputs.force_lost, "axis": inputs.axis_lost, "marker": inputs.marker_lost}
        return {
            "time_ns": row.capture_ns,
            "mode": self.connections.shown_mode(Mode(row.mode)),
            "busy": self.machine.busy,
            "step": row.step,
            "health": row.health,
            "missed": row.missed,
            "cycles": row.seq + 1,
            "force_N": _finite(row.force_N),
            "peak_force_N": _finite(self.state.peak_force_N),
            "reference_N": _finite(row.reference_N),
            "position_mm": _finite(row.position_mm),
            "depth_mm": _finite(row.depth_mm),
            "rates_Hz": {name: round(stream.rate_Hz, 1) for name, stream in self.health.items()},
            "lost": {name: cause for name, cause in lost.items() if cause},
            "devices": takeover.as_status((*self.connections.statuses.items(), *self.input_statuses.items())),
            "ready": self.connections.ready and not inputs.input_lost,
            "latched": {"code": latched.code, "text": latched.text, "action": latched.action.name} if latched else None,
        }


class Commands(Protocol):
    """What the supervisor asks of the loop."""

    @property
    def heard_ns(self) -> int:
        """When the other end last said anything; 0 before that."""

    def stop_silent_s(self, now_ns: int) -> float:
        """Since the stop process last looked for presses [s]."""

    def collect(self, loop: BenchLoop) -> frozenset[str]:
        """Takes what has come, acts on it, and returns the stop requests among it."""

    def confirm(self, loop: BenchLoop) -> None:
        """Says what came of the stop requests, once the axis has been told."""

    def more(self, loop: BenchLoop) -> bool:
        """Whether the loop goes on."""


def _finite(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None
