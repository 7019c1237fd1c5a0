"""What the supervisor asks of the loop, taken at most one message a tick."""

from datetime import UTC, datetime

from controller.attending import refusal as missing_device
from controller.bench_loop import BenchLoop
from controller.checks import refuse_beyond_limits
from controller.commissioning.refusals import refuse_uncommissioned
from controller.messages import Lease, Note, Reset, Run, Shutdown, Stop
from controller.safety import Action
from controller.steps import Program
from rig.channel import Answer, Channel, Received
from rig.errors import RigError, UsageError


class Inbox:
    """Messages of `controller.messages`, each answered by its id; any of them renews the operator's lease."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._leaving = False
        self._refused = 0
        self.heard_ns = 0

    def collect(self, loop: BenchLoop) -> frozenset[str]:
        """One message at most; a refused one is answered with its reason."""
        received = None if self._channel.lost else self._channel.receive()
        if self._channel.refused > self._refused:
            self._refused = self._channel.refused
            text = f"{self._refused} messages to the loop were not understood so far"
            loop.event(Action.WARNING, "refused", text, loop.world.now_ns)
        return self._take(received, loop) if received else frozenset()

    def _take(self, received: Received, loop: BenchLoop) -> frozenset[str]:
        self.heard_ns = loop.world.now_ns
        match received.message:
            case Stop(kind=kind):
                return frozenset({kind})
            case Lease(attending=attending):
                return frozenset() if attending else frozenset({"unattended"})
        try:
            self._act(received, loop)
        except RigError as refusal:
            loop.event(Action.WARNING, "refused", str(refusal), loop.world.now_ns)
            self._channel.send(Answer(to=received.id, refused=str(refusal)))
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
                loop.event(Action.NOTE, "reset", "stop acknowledged", loop.world.now_ns)
            case Note(code=code, text=text):
                loop.event(Action.NOTE, code, text, loop.world.now_ns)
            case Shutdown():
                self._leaving = True

    def _start(self, number: int, program: Program, loop: BenchLoop) -> None:
        if loop.machine.busy:
            raise UsageError("a program is already under way: stop it or wait for its end")
        if loop.machine.latched:
            raise UsageError(f"stopped by {loop.machine.latched.text}: acknowledge it with a reset first")
        missing = missing_device(loop, program, loop.world.now_ns)
        if missing:
            raise UsageError(missing)
        refuse_beyond_limits(program, loop.wiring)
        force, axis = loop.devices.force.identity, loop.devices.axis.identity
        refuse_uncommissioned(program, loop.wiring, force, axis, datetime.now(UTC))
        loop.event(Action.NOTE, "program_start", program.name, loop.world.now_ns)
        loop.start(program, number)

    def more(self, loop: BenchLoop) -> bool:
        """False once asked to leave, or left alone, and at rest."""
        return loop.machine.busy or not (self._leaving or self._channel.lost)
