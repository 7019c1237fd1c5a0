"""The program that runs the bench during a trial: a thread of this process, or a process of its own."""

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.faults import planted_loop
from benchmarks.faults.commission import SCENARIO as COMMISSIONING
from benchmarks.faults.commission import commission
from benchmarks.faults.fault import Fault, Live
from benchmarks.faults.scenarios import SCENARIOS, Ended
from controller.supervisor import LOOP_MODULE, Supervisor
from mock_devices.testing.commands import ServedBench
from rig.config.wiring import Wiring
from rig.errors import RigError, UsageError

LONGEST_S = 60.0


@dataclass
class Program:
    """What is under way; ``ended`` is there once it is over."""

    live: Live
    ended: Ended | None = None
    started: threading.Event = field(default_factory=threading.Event)

    def begin(self) -> None:
        """Lets the scenario begin."""
        self.started.set()

    def wait(self) -> Ended:
        """Its end."""
        raise NotImplementedError


class Here(Program):
    """The scenario in a thread of this process."""

    def __init__(self, live: Live, fault: Fault, folder: Path) -> None:
        super().__init__(live)
        self._thread = threading.Thread(target=self._run, args=(fault.scenario, folder), daemon=True)
        self._thread.start()

    def _run(self, scenario: str, folder: Path) -> None:
        self.started.wait()
        try:
            self.ended = SCENARIOS[scenario].perform(self.live.supervisor, folder)
        except RigError as error:
            self.ended = Ended(str(error), refused=isinstance(error, UsageError))

    def wait(self) -> Ended:
        """Its end; raises UsageError where there is none."""
        self._thread.join(LONGEST_S)
        if self.ended is None:
            raise UsageError(f"the scenario did not end within {LONGEST_S:g} s")
        return self.ended


class Commissioning(Program):
    """No program, only the calibration of the force sensor."""

    def __init__(self, live: Live, wiring: Wiring) -> None:
        super().__init__(live)
        self._wiring = wiring

    def wait(self) -> Ended:
        """Its end; raises RigError where it is refused."""
        commission(self._wiring, self.live.bench)
        return Ended("complete")


class Apart(Program):
    """The scenario in a process of its own; one that was killed says nothing at its end."""

    def __init__(self, live: Live, process: "subprocess.Popen[str]") -> None:
        super().__init__(live)
        self._process = process

    def wait(self) -> Ended:
        """Its end."""
        assert self._process.stdout
        line = self._process.stdout.readline()
        said = json.loads(line) if line else {"cause": "killed"}
        self.ended = Ended(said["cause"], said.get("verdict", ""), tuple(said.get("measures", ())))
        return self.ended


@contextlib.contextmanager
def program(bench: ServedBench, wiring: Wiring, fault: Fault, folder: Path, planted: str = "") -> Iterator[Program]:
    """The program for ``fault`` with its bench ready; the loop lacks the checks ``planted`` (codes with commas)."""
    module = planted_loop.MODULE if planted else LOOP_MODULE
    with _environment(planted):
        if fault.scenario == COMMISSIONING:
            yield Commissioning(Live(bench, os.getpid()), wiring)
        elif fault.apart:
            with _apart(bench, wiring, fault, folder, module) as running:
                yield running
        else:
            with Supervisor(wiring, loop_module=module) as rig:
                yield Here(Live(bench, os.getpid(), rig, Path(wiring.stop.keypad)), fault, folder)


@contextlib.contextmanager
def _apart(bench: ServedBench, wiring: Wiring, fault: Fault, folder: Path, module: str) -> Iterator[Program]:
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.faults.operator"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdin and process.stdout
    asked = {
        "wiring": wiring.model_dump(mode="json"),
        "scenario": fault.scenario,
        "folder": str(folder),
        "loop_module": module,
    }
    try:
        process.stdin.write(json.dumps(asked) + "\n")
        process.stdin.flush()
        if not process.stdout.readline():
            raise UsageError("the operator's program did not start; its reason stands above")
        yield Apart(Live(bench, process.pid), process)
    finally:
        process.stdin.close()
        process.kill()
        process.wait()
        process.stdout.close()


@contextlib.contextmanager
def _environment(planted: str) -> Iterator[None]:
    os.environ[planted_loop.VARIABLE] = planted
    try:
        with planted_loop.replaced(planted.split(",")):
            yield
    finally:
        del os.environ[planted_loop.VARIABLE]
