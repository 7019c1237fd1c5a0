"""The service's side of a calibration, which has the devices to itself; what moves the axis is stopped as a run is."""

import contextlib
import os
import re
import threading
import time
from collections.abc import Callable, Iterator

from api.http.commissioning.params import (
    CalibrateAxisParams,
    CalibrateDynamicsParams,
    CalibrateForceParams,
    CalibrateGloveParams,
)
from api.http.jobs.job import Job
from api.http.service import Service
from api.operations.calibrate import refuse_axis
from api.operations.calibrate_dynamics import sweep_asked
from api.operations.calibrations import refuse_out
from api.operations.glove import HEAVIEST_N
from controller.experiments.glove import glove_of
from controller.stop.word import Deed, Responder, StopWord
from controller.supervisor import NOT_IN_CONTROL, Supervisor
from rig.config.wiring import Wiring
from rig.errors import DeviceError, SafetyStop, UsageError
from rig.results.base import SavedResult

OPTION = re.compile(r"--([a-z][a-z-]*)")
# A tenth of a second after control is lost the axis brakes: two millimetres at the 20 mm/s of its homing. Stops are
# waited for five times as long.
LOOK_S = 0.1
RESTS = "a calibration has the devices, and nothing moves; connect when it has ended"
MOVES = "a calibration has the devices and moves the axis, which every stop brakes; connect when it has ended"


def refuse_undoable(asked: object, wiring: Wiring, by_itself: bool) -> None:
    """Raises UsageError while the bench still goes on; ``by_itself``: the mock bench needs nobody, and knows itself."""
    try:
        _refuse(asked, wiring, by_itself)
    except UsageError as error:  # checks of the command line too, which speak of its options
        raise UsageError(OPTION.sub(lambda option: option[1].replace("-", "_"), str(error))) from error


def _refuse(asked: object, wiring: Wiring, by_itself: bool) -> None:
    refuse_out(None)
    match asked:
        case CalibrateForceParams():
            asked.up_to(wiring.limits.force_N, asked.load == "hung")
        case CalibrateGloveParams():
            glove_of(wiring, asked.input)
            asked.up_to(HEAVIEST_N)
        case CalibrateAxisParams():
            if asked.gauge_block_mm and asked.near_mm is None and not by_itself:
                raise UsageError("near_mm: where is the table? give the axis position just before it, in mm")
            refuse_axis(asked.asked, wiring)
        case CalibrateDynamicsParams():
            sweep_asked(wiring, asked.from_mm)


class Alone:
    """A calibration while no loop runs; stops of service, other computers and foot switch reach it all the same."""

    def __init__(self, service: Service, job: Job, moves_axis: bool) -> None:
        self._service, self._job, self._moves_axis = service, job, moves_axis
        self._stops = Supervisor(service.wiring)  # of which nothing but the stop process is started
        self._over, self._left = threading.Event(), False

    @property
    def word(self) -> str:
        """Where the stop word will be; empty where the axis does not move."""
        return str(self._stops.stop_path) if self._moves_axis else ""

    def begun(self, work: Callable[[], SavedResult]) -> Job:
        """The job, under way; raises RequestRefused where another is, or a stop is in force."""
        self._job.give_up = end = self._job.interrupt

        def interrupt() -> None:
            self._stop()
            end()

        def alone() -> SavedResult:
            with self._service.released(MOVES if self._moves_axis else RESTS), self._stoppable():
                return work()

        if self._moves_axis:
            self._job.interrupt = interrupt
        with self._service.starting:
            self._service.jobs.refuse_busy()
            if self._service.seen_devices() is not None:
                self._service.refuse_stopped()
            return self._service.jobs.start_moving(self._job, alone)

    def _stop(self) -> None:
        with contextlib.suppress(DeviceError):  # it has not begun, or has ended
            self._stops.stop()

    @contextlib.contextmanager
    def _stoppable(self) -> Iterator[None]:
        looks_on = self._attend if self._moves_axis else self._hold
        watching = threading.Thread(target=looks_on, name=f"attended-{self._job.id}", daemon=True)
        with self._service.stopping(self._stops):
            watching.start()
            try:
                yield
            except SafetyStop as stop:
                if not self._left:
                    raise
                raise SafetyStop(NOT_IN_CONTROL, "operator_silent") from stop
            finally:
                self._over.set()
                watching.join()

    def _attend(self) -> None:
        """Until it is over; while a person is waited for nothing moves, and whoever goes on is in control."""
        while not self._over.wait(LOOK_S):
            if self._job.state == "running" and not self._service.attended():
                self._left = True
                self._stop()
                return

    def _hold(self) -> None:
        """Until it is over: answers each stop that nothing moves, and ends the job by it."""
        with contextlib.closing(StopWord.open(self._stops.stop_path)) as page:
            responder = Responder(page)
            responder.attach(os.getpid())
            while not self._over.wait(LOOK_S):
                if responder.take(time.monotonic_ns()):
                    responder.answer(Deed.HELD, time.monotonic_ns())
                    self._job.stopped()
                    self._job.give_up()
