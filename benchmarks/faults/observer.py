"""What is true on the bench while a fault happens, polled over a connection of its own beside the run."""

import threading
import time
from collections.abc import Callable

from benchmarks.faults.evaluation import Notice
from benchmarks.faults.scenarios import Truth
from controller.supervisor import Supervisor
from mock_devices.control import BenchControl
from rig.errors import RigError

FIGURES = ("tip.force_N", "tip.depth_mm", "tip.position_mm", "tip.velocity_mm_s", "axis.powered", "surface.position_mm")
POLL_S = 0.001


class Observer:
    """Largest true force, when the drive lost its torque, and when a condition first held; times are monotonic ns."""

    def __init__(self, address: str) -> None:
        self.peak_N = 0.0
        self.unpowered_ns: int | None = None
        self.onset_ns: int | None = None
        self.notices: list[Notice] = []
        self._rig: Supervisor | None = None
        self._truth: Truth = {}
        self._onset: Callable[[Truth], bool] | None = None
        self._over = threading.Event()
        self._control = BenchControl(address)
        self._look()
        self._thread = threading.Thread(target=self._poll, name="observer", daemon=True)
        self._thread.start()

    @property
    def truth(self) -> Truth:
        """The newest figures."""
        return self._truth

    def listen(self, rig: Supervisor | None) -> None:
        """From now on the loop's own word of what stopped it is noted too, which a dead recorder cannot do."""
        self._rig = rig

    def expect(self, onset: Callable[[Truth], bool]) -> None:
        """From now on the first moment counts at which ``onset`` holds."""
        self._onset = onset

    def _poll(self) -> None:
        while not self._over.wait(POLL_S):
            try:
                self._look()
            except RigError:  # the bench has ended, or is held by a fault for longer than a request may take
                return

    def _look(self) -> None:
        self._truth = truth = {name: float(value) for name, value in self._control.get(*FIGURES).items()}
        now_ns = time.monotonic_ns()
        self.peak_N = max(self.peak_N, truth["tip.force_N"])
        if truth["axis.powered"]:
            self.unpowered_ns = None
        elif self.unpowered_ns is None:
            self.unpowered_ns = now_ns
        incidents = self._rig.incidents if self._rig else []
        self.notices += [Notice(one.code, now_ns, one.text) for one in incidents[len(self.notices) :]]
        if self._onset and self.onset_ns is None and self._onset(truth):
            self.onset_ns = now_ns

    def close(self) -> None:
        """Ends it."""
        self._over.set()
        self._thread.join()
        self._control.close()
