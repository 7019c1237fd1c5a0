"""A mock bench in a process of its own, and the `rig` command run against it as a user runs it."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from api.cli.mock_bench import plug_into
from api.cli.mock_calibration import force_file
from api.cli.mock_dynamics import dynamics_file
from api.cli.options import built_in
from mock_devices.control import BenchControl
from rig.config.endpoints import Endpoints

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
RIG = [sys.executable, "-c", "from api.cli.__main__ import main; main()"]
# A computer that others use too stops any process for a while, which no bench in a lab would be allowed to. What is
# tested here is what stops motion and that it does; how old a sample may be is tested in tests/controller, on a clock
# in the test's hand.
PATIENT = (
    "loop.missed_periods=0",
    "loop.stale_force_ms=1000",
    "loop.stale_axis_ms=1000",
    "loop.stale_marker_ms=1500",
    "loop.overrun_ms=1000",
    "axis.heartbeat_ms=500",
    "axis.following_error_mm=30",
)
PATIENCE_S = 60.0


@dataclass(frozen=True)
class ServedBench:
    """Endpoints of a served bench and its control channel."""

    endpoints: Endpoints
    control: BenchControl

    def settings(self, *more: str) -> list[str]:
        """Options that plug a command into this bench and make it patient, force sensor and axis calibrated."""
        force, axis, tracker = (self.endpoints.devices[role] for role in ("force", "axis", "tracker"))
        ports: tuple[str, ...] = (
            f"force.port={force['serial']}",
            f"axis.port={axis['slcan']}",
            f"tracker.port=tcp://{tracker['tcp']}",
        )
        if not any(setting.startswith("axis.product=") for setting in more):
            ports += ("axis.increments_per_mm=2000",)
        late = [f"{role}.latency_ms={self.endpoints.latency_ms[role]}" for role in ("force", "tracker")]
        force_known, axis_known = self.calibrated(*more)
        known = [f"calibration.force={force_known}", f"calibration.dynamics={axis_known}"]
        return [part for setting in (*ports, *late, *known, *PATIENT, *more) for part in ("--set", setting)]

    def calibrated(self, *more: str) -> tuple[Path, Path]:
        """Files of force calibration and axis dynamics, for the product and the rate that ``more`` names."""
        wiring = built_in([setting for setting in more if setting.startswith(("force.product=", "loop.rate_Hz="))])
        plug_into(wiring, self.endpoints)
        return force_file(wiring, self.endpoints), dynamics_file(wiring, self.endpoints)


@contextlib.contextmanager
def served_bench(*options: str) -> Iterator[ServedBench]:
    """A bench served with ``options`` until the block ends."""
    command = [
        sys.executable,
        "-m",
        "mock_devices.serve",
        "--with-parent",
        "--tracker-tcp-port",
        "0",
        "--priority",
        "10",
        *options,
    ]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin and process.stdout
    try:
        endpoints = Endpoints.model_validate_json(process.stdout.readline())
        with BenchControl(endpoints.control) as control:
            served = ServedBench(endpoints, control)
            served.calibrated()  # kept from then on: a fault that a test brings about must not meet the first time
            yield served
    finally:
        process.stdin.close()
        process.wait(20)
        process.stdout.close()


@dataclass(frozen=True)
class Said:
    """What a command ended with."""

    code: int
    out: str
    err: str

    @property
    def sentence(self) -> str:
        """The last line on stderr, where a failure is explained; there is never a traceback."""
        assert "Traceback" not in self.err, self.err
        lines = [line for line in self.err.splitlines() if line.startswith("rig: ")]
        assert len(lines) == 1, self.err
        return lines[0]


class Running:
    """A `rig` command under way; ``started`` lists all there were, so that none outlives its test."""

    started: ClassVar[list["Running"]] = []

    def __init__(
        self,
        arguments: Sequence[str | Path],
        folder: Path,
        stdin: int = subprocess.DEVNULL,
        terminal: int | None = None,
    ) -> None:
        """``terminal``: reads and writes there and nowhere else, and is told when it is closed."""
        path = os.pathsep.join([str(ROOT), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]).strip(os.pathsep)
        environment = os.environ | {"COLUMNS": "200", "PYTHONPATH": path}
        own = [] if terminal is None else ["setsid", "--ctty"]
        self.process = subprocess.Popen(
            [*own, *RIG, *map(str, arguments)],
            cwd=folder,
            env=environment,
            stdin=stdin if terminal is None else terminal,
            stdout=subprocess.PIPE if terminal is None else terminal,
            stderr=subprocess.PIPE if terminal is None else terminal,
            text=True,
        )
        self.started.append(self)

    def kill(self) -> None:
        """Ends it without asking; nothing if it has ended."""
        if self.process.returncode is None:
            self.process.kill()
            self.process.communicate()

    def interrupt(self) -> None:
        """Ctrl-C."""
        self.process.send_signal(signal.SIGINT)

    def end(self, timeout_s: float = 90.0) -> Said:
        """Waits for its end."""
        try:
            out, err = self.process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            out, err = self.process.communicate()
            raise AssertionError(f"still running after {timeout_s} s\n{out}\n{err}") from None
        return Said(self.process.returncode, out or "", err or "")


def pressed(bench: ServedBench, force_N: float = 1.0) -> None:
    """Waits until the tip presses with ``force_N``; a command that ended before that fails with what it said."""

    def there() -> bool:
        for running in Running.started:
            assert running.process.poll() is None, running.end()
        return bench.control.number("tip.force_N") > force_N

    until(there, PATIENCE_S, f"the tip pressing with {force_N} N")


def homing(bench: ServedBench) -> None:
    """Waits until the axis is under way to its reference."""
    until(lambda: bench.control.get("axis.powered")["axis.powered"], PATIENCE_S, "the axis powered")
    at_rest_mm = bench.control.number("axis.position_mm")
    until(lambda: abs(bench.control.number("axis.position_mm") - at_rest_mm) > 0.1, PATIENCE_S, "the axis homing")


def freed(bench: ServedBench) -> None:
    """Waits until the tip is out of the tissue."""
    until(lambda: bench.control.number("tip.force_N") == 0.0, PATIENCE_S, "the tip out of contact")


def stands_still(bench: ServedBench, within_mm: float = 0.02) -> None:
    """Sees that the axis does not move for 0.3 s of the bench's own time, however slow the computer is."""
    stood_mm, until_s = bench.control.number("axis.position_mm"), bench.control.number("time_s") + 0.3
    until(lambda: bench.control.number("time_s") > until_s, PATIENCE_S, "the bench 0.3 s on")
    moved_mm = bench.control.number("axis.position_mm") - stood_mm
    assert abs(moved_mm) <= within_mm, f"the axis moved by {moved_mm:.3f} mm"


def rig(*arguments: str | Path, folder: Path, timeout_s: float = 90.0) -> Said:
    """Runs a `rig` command to its end."""
    return Running(arguments, folder).end(timeout_s)


def until(condition: Any, timeout_s: float, what: str) -> None:
    """Waits for ``condition()``; fails with ``what``."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, f"not within {timeout_s} s: {what}"
        time.sleep(0.01)


def free_port() -> int:
    """A TCP port nobody listens on, below those that the kernel gives to clients: nobody takes it in between."""
    for port in range(20_000 + os.getpid() % 5_000, 32_000):
        with contextlib.suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return port
    raise AssertionError("no free TCP port from 20000 to 32000")


def children(pid: int, module: str) -> list[int]:
    """Process numbers of ``pid``'s children that run ``module``."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                status, command = (entry / "status").read_text(), (entry / "cmdline").read_text()
            except OSError:
                continue
            if f"PPid:\t{pid}\n" in status and module in command:
                found.append(int(entry.name))
    return found
