"""What the supervisor asks of the loop, taken at most one message a tick."""

from controller.bench_loop import BenchLoop
from controller.checks import refuse_beyond_limits
from controller.link import Link, Message
from controller.safety import Action
from controller.steps import Program
from rig.config.table import parse
from rig.errors import RigError, UsageError

STOPS = {"stop", "pain", "estop", "unattended"}


class Inbox:
    """Messages of the form ``{"do": verb, ...}``: program, stop, pain, estop, unattended, reset, note, lease, shutdown.

    Any of them renews the lease of the operator's program.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._leaving = False
        self.heard_ns = 0

    def collect(self, loop: BenchLoop) -> frozenset[str]:
        """One message at most; a refused one is answered with its reason."""
        message = None if self._link.lost else self._link.receive()
        if message is None:
            return frozenset()
        self.heard_ns = loop.world.now_ns
        verb = str(message.get("do"))
        if verb in STOPS:
            return frozenset({verb})
        try:
            self._act(verb, message, loop)
        except RigError as refusal:
            loop.event(Action.WARNING, "refused", str(refusal), loop.world.now_ns)
            self._link.send({"refused": {"do": verb, "text": str(refusal)}})
        return frozenset()

    def _act(self, verb: str, message: Message, loop: BenchLoop) -> None:
        match verb:
            case "program":
                self._start(parse(Program, message["program"], "program"), loop)
            case "reset":
                if loop.machine.latched and loop.machine.busy:
                    raise UsageError("the tip still retracts: wait until it stands, then acknowledge the stop")
                loop.release()
                loop.event(Action.NOTE, "reset", "stop acknowledged", loop.world.now_ns)
                self._link.send({"reset": loop.world.now_ns})
            case "note":
                loop.event(Action.NOTE, str(message["code"]), str(message["text"]), loop.world.now_ns)
            case "lease":
                pass
            case "shutdown":
                self._leaving = True
            case _:
                raise UsageError(f"the loop does not know how to {verb}")

    def _start(self, program: Program, loop: BenchLoop) -> None:
        if loop.machine.busy:
            raise UsageError("a program is already under way: stop it or wait for its end")
        if loop.machine.latched:
            raise UsageError(f"stopped by {loop.machine.latched.text}: acknowledge it with a reset first")
        refuse_beyond_limits(program, loop.wiring)
        loop.event(Action.NOTE, "program_start", program.name, loop.world.now_ns)
        loop.start(program)

    def more(self, loop: BenchLoop) -> bool:
        """False once asked to leave, or left alone, and at rest."""
        return loop.machine.busy or not (self._leaving or self._link.lost)
