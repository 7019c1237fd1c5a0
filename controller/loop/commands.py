"""What the supervisor asks of the loop, at most one message a cycle, and the stop word, every cycle."""

from datetime import UTC, datetime

from controller.commissioning.refusals import refuse_uncommissioned
from controller.devices.drivers import Interruption
from controller.devices.takeover import refusal as missing_device
from controller.loop.bench_loop import BenchLoop
from controller.loop.messages import Heartbeat, Note, Recover, Reset, Run, Shutdown, Survey, Surveyed
from controller.loop.modes import Mode
from controller.loop.steps import Program
from controller.recovery import acts as recovery_acts
from controller.safety.program_limits import refuse_beyond_limits
from controller.safety.table import Action
from controller.stop.start import StartGuard
from controller.stop.word import DEEDS, Deed, Responder, StopReason, StopRequest
from drivers.epos4.walker import never
from rig.channel import Answer, Channel, Received
from rig.errors import RigError, SafetyStop, UsageError

REQUESTS = {
    StopReason.STOP: frozenset({"stop"}),
    StopReason.PAIN: frozenset({"pain"}),
    StopReason.EMERGENCY: frozenset({"estop"}),
    StopReason.KEYPAD_LOST: frozenset({"stop", "keypad"}),
    StopReason.RECORDING_LOST: frozenset({"recording"}),
}
"""What each kind of stop is called in the safety table's checks."""


class Inbox:
    """Messages of `controller.loop.messages`, each answered by its id; any of them renews the operator's lease."""

    def __init__(self, channel: Channel, stops: Responder, interruption: Interruption | None = None) -> None:
        self._channel, self._stops = channel, stops
        self.interruption = interruption or Interruption()
        self._asked: tuple[StopRequest, ...] = ()
        self._leaving = self._told_to_end = False
        self._refused = 0
        self.heard_ns = 0

    def end(self) -> None:
        """What moves is stopped and retracted, then the loop leaves; may be called by a signal's handler."""
        self._leaving = self._told_to_end = True

    def stop_silent_s(self, now_ns: int) -> float:
        """Since the stop process last looked for presses [s]."""
        return self._stops.server_silent_s(now_ns)

    def collect(self, loop: BenchLoop) -> frozenset[str]:
        """All stops that were asked for, and one message at most; a refused one is answered with its reason."""
        self._asked = self._stops.take(loop.now())
        wanted = self._hear(loop)
        if self._told_to_end and loop.machine.busy:
            wanted |= {"stop"}
        return wanted.union(*(REQUESTS[request.kind] for request in self._asked))

    def confirm(self, loop: BenchLoop) -> None:
        """Answers the stops taken in this cycle with what was done; one that nothing came of stays asked for."""
        if not self._asked:
            return
        deed = _deed(loop, self._asked)
        if deed is None:
            return
        now_ns = loop.now()
        self._stops.answer(deed, now_ns)
        for request in self._asked:
            loop.event(Action.NOTE, "stop_answered", f"{request.kind.name} {request.id}: {DEEDS[deed]}", now_ns)

    def _hear(self, loop: BenchLoop) -> frozenset[str]:
        received = None if self._channel.lost else self._channel.receive()
        if self._channel.refused > self._refused:
            self._refused = self._channel.refused
            text = f"{self._refused} messages to the loop were not understood so far"
            loop.event(Action.WARNING, "refused", text, loop.state.now_ns)
        return self._take(received, loop) if received else frozenset()

    def _take(self, received: Received, loop: BenchLoop) -> frozenset[str]:
        self.heard_ns = loop.state.now_ns
        if isinstance(received.message, Heartbeat):
            return frozenset() if received.message.attending else frozenset({"unattended"})
        try:
            self._act(received, loop)
        except RigError as refusal:
            loop.event(Action.WARNING, "refused", str(refusal), loop.state.now_ns)
            stopped = isinstance(refusal, SafetyStop)
            self._channel.send(Answer(to=received.id, refused=str(refusal), stopped=stopped))
        else:
            self._channel.send(Answer(to=received.id))
        return frozenset()

    def _act(self, received: Received, loop: BenchLoop) -> None:
        match received.message:
            case Run(program=program):
                self._start(received.id, program, loop)
            case Reset():
                if loop.machine.latched and loop.machine.busy:
                    raise UsageError("the tip still retracts: wait until it stands, then acknowledge the stop")
                loop.release()
                loop.event(Action.NOTE, "reset", "stop acknowledged", loop.state.now_ns)
            case Survey():
                self._channel.send(Surveyed(to=received.id, situation=recovery_acts.survey(loop)))
            case Recover(act="home"):
                self._home(loop)
            case Recover(act=act):
                recovery_acts.do(loop, act)
            case Note(code=code, text=text):
                loop.event(Action.NOTE, code, text, loop.state.now_ns)
            case Shutdown():
                self._leaving = True

    def _start(self, number: int, program: Program, loop: BenchLoop) -> None:
        if loop.machine.busy:
            raise UsageError("a program is already under way: stop it or wait for its end")
        if loop.machine.latched:
            raise SafetyStop(f"stopped by {loop.machine.latched.text}: acknowledge it with a reset first")
        if self._asked:
            raise SafetyStop("a stop was asked for at the same moment: acknowledge it with a reset first")
        missing = missing_device(loop, program, loop.state.now_ns)
        if missing:
            raise UsageError(missing)
        refuse_beyond_limits(program, loop.wiring)
        force, axis = loop.devices.force.identity, loop.devices.axis.identity
        refuse_uncommissioned(program, loop.wiring, force, axis, datetime.now(UTC))
        loop.event(Action.NOTE, "program_start", program.name, loop.state.now_ns)
        loop.start(program, number)

    def _home(self, loop: BenchLoop) -> None:
        """The loop stands still while the drive homes, so stops are taken beside it, as at its start."""
        with StartGuard(self._stops, loop.now) as guard:
            self.interruption.source = guard.interrupted
            try:
                with guard.moving():
                    recovery_acts.do(loop, "home")
            finally:
                # A stop of this homing is none of what the drive is asked for later.
                self.interruption.source = never

    def more(self, loop: BenchLoop) -> bool:
        """False once asked to leave, or left alone, and at rest."""
        return loop.machine.busy or not (self._leaving or self._channel.lost)


def _deed(loop: BenchLoop, asked: tuple[StopRequest, ...]) -> Deed | None:
    if loop.inputs.axis_lost:
        return Deed.AXIS_LOST
    if loop.braked:
        return Deed.BRAKED
    if loop.machine.mode in (Mode.IDLE, Mode.SAFE):
        return Deed.HELD
    # Whoever asked for an emergency stop is not told that a retraction will do.
    brake = any(request.kind is StopReason.EMERGENCY for request in asked)
    return Deed.RETRACTING if loop.machine.latched and not brake else None
