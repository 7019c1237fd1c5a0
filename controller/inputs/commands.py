"""The loop's commands with its inputs beside them: what a switch asks for counts like any other stop."""

from pathlib import Path

from controller.inputs.client import inputs_path
from controller.inputs.feed import InputFeed, RowRing
from controller.loop.bench_loop import BenchLoop, Commands
from rig.config.wiring import Wiring
from rig.recording.ring import RingReader


class WithInputs:
    """``commands`` with a feed of inputs."""

    def __init__(self, commands: Commands, feed: InputFeed) -> None:
        self._commands, self._feed = commands, feed

    @property
    def heard_ns(self) -> int:
        """When the other end last said anything."""
        return self._commands.heard_ns

    def stop_silent_s(self, now_ns: int) -> float:
        """Since the stop process last looked for presses [s]."""
        return self._commands.stop_silent_s(now_ns)

    def collect(self, loop: BenchLoop) -> frozenset[str]:
        """Switches first, so that a program is refused that begins in the same cycle."""
        asked = self._feed.collect(loop)
        return asked | self._commands.collect(loop)

    def confirm(self, loop: BenchLoop) -> None:
        """Says what came of the stop requests that have ids; a switch has none."""
        self._commands.confirm(loop)

    def more(self, loop: BenchLoop) -> bool:
        """Whether the loop goes on."""
        return self._commands.more(loop)


def with_inputs(commands: Commands, wiring: Wiring, ring: RowRing, path: Path, now_ns: int) -> Commands:
    """``commands``, with what the inputs bring where there are any; ``path`` is that of the loop's ring."""
    if not wiring.input:
        return commands
    return WithInputs(commands, InputFeed(wiring.input, RingReader.open(inputs_path(path)), ring, now_ns))
