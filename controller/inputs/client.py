"""The supervisor's side of the process of the inputs: starts it where there are any, and ends it."""

import subprocess
import sys
import time
from pathlib import Path

from rig.config.wiring import Wiring
from rig.errors import DeviceError

START_S, END_S = 10.0, 6.0
LOOK_S = 0.005


class InputsProcess:
    """The process and its ring at ``path``; raises DeviceError where it does not start."""

    def __init__(self, wiring: Wiring, path: Path) -> None:
        self._path = path
        self._process = subprocess.Popen(
            [sys.executable, "-m", "controller.inputs.process", wiring.model_dump_json(), str(path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        self._await()

    @property
    def pid(self) -> int:
        """Its process number."""
        return self._process.pid

    def _await(self) -> None:
        deadline_s = time.monotonic() + START_S
        while not self._path.exists():
            if self._process.poll() is not None or time.monotonic() > deadline_s:
                self.close()
                raise DeviceError(f"the process of the inputs did not start within {START_S:g} s; its reason is above")
            time.sleep(LOOK_S)

    def close(self) -> None:
        """Ends it; may be called twice."""
        if self._process.stdin:
            self._process.stdin.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._path.unlink(missing_ok=True)


def inputs_path(ring: Path) -> Path:
    """Where the inputs' ring stands beside the loop's."""
    return ring.with_suffix(".inputs")


def started_inputs(wiring: Wiring, ring: Path) -> InputsProcess | None:
    """The process; None where no input is configured."""
    return InputsProcess(wiring, inputs_path(ring)) if wiring.input else None
