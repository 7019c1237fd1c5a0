"""What moves the axis while it is calibrated: the drive's own moves from rest to rest, the force looked at between.

No loop runs meanwhile: between two moves everything is read, and what presses on the tip ends it.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import NamedTuple, TypeVar

import numpy as np

from controller.commissioning.axis import Array, Place, ahead_mm, known_direction, refuse_first_step
from controller.commissioning.stoppable import awaited
from controller.devices.drivers import Devices
from rig.channels import MarkerSample
from rig.errors import CheckFailed, DeviceError, SafetyStop

PERIOD_S = 0.001
# Between zero and what a person takes for a touch; the tip moves in the air.
LARGEST_TOUCH_N = 0.5
# On steel, 0.05 mm meets the stiffness of the bench alone, some 100 N/mm: 5 N at most, one step after the first touch.
STEP_MM, CONTACT_N, SEARCH_MM, BACK_MM, TOUCHES = 0.05, 0.3, 5.0, 1.0, 3
# A computer that was stopped for a while has read nothing yet when its time is over.
SILENT_S = 0.5
# What came during a move was measured under way.
DRAIN_S, TOUCH_READ_S = 0.04, 0.08
# Thirty frames at each end know it to 2 %, and 20 % are asked.
FIRST_STEP_MM = 1.0
TIP, ARM = 0, 1
T = TypeVar("T")


class Pace(NamedTuple):
    """How fast from rest to rest, and how long to rest before and while reading.

    The axis' own ripple and the smoothing of the drive are gone after a tenth of a second; a camera is 15 to 100 ms
    late, and half a second of it are 30 frames.
    """

    speed_mm_s: float = 5.0
    settle_s: float = 0.3
    read_s: float = 0.5


PACE = Pace()


class RestingAxis:
    """Devices that are started and an axis that is homed; ``moving`` is around whatever moves it."""

    def __init__(
        self,
        devices: Devices,
        moving: Callable[[], AbstractContextManager[None]] = nullcontext,
        pace: Pace = PACE,
        refuse_stopped: Callable[[], object] = lambda: None,
        now: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._devices, self._moving, self._pace, self._now, self._sleep = devices, moving, pace, now, sleep
        self._refuse_stopped = refuse_stopped
        self._reference_N: Array | None = None

    def go(self, position_mm: float) -> None:
        """By the drive's own profile, to rest; raises SafetyStop where a stop was asked for."""
        with self._moving():
            self._devices.axis.move_to(position_mm, self._pace.speed_mm_s)

    def place(self) -> Place:
        """Where everything is, at rest; raises SafetyStop where something presses on the tip."""
        self._read(self._pace.settle_s)
        axis_mm, markers, force_N = self._read(self._pace.read_s)
        if self._reference_N is None:
            self._reference_N = force_N
        load_N = float(np.linalg.norm(force_N - self._reference_N))
        if load_N > LARGEST_TOUCH_N:
            raise SafetyStop(
                f"{load_N:.2g} N on the tip at {axis_mm:.2f} mm (limit {LARGEST_TOUCH_N:g} N): something is in its way"
            )
        return Place(axis_mm, _places(markers, TIP), _places(markers, ARM))

    def load_N(self, read_s: float = TOUCH_READ_S) -> tuple[float, float]:
        """Position [mm] and load [N] since ``place`` was first asked for."""
        self._read(DRAIN_S)
        axis_mm, _, force_N = self._read(read_s)
        assert self._reference_N is not None
        return axis_mm, float(np.linalg.norm(force_N - self._reference_N))

    def wait_for(self, act: Callable[[], T]) -> T:
        """What ``act`` returns, which may take a person minutes: the drive hears from us meanwhile; a stop ends it."""

        def look() -> None:
            self._refuse_stopped()
            self._read(DRAIN_S)

        return awaited(act, look)

    def _read(self, seconds: float) -> tuple[float, list[MarkerSample], Array]:
        """Mean position, frames and mean force of a while; the reading keeps the drive's heartbeat going.

        Of samples taken in it alone: a computer held up before it fetches what was measured under way, or unrested.
        """
        positions: list[float] = []
        markers: list[MarkerSample] = []
        forces: list[tuple[float, ...]] = []
        axis, force, tracker = self._devices.axis, self._devices.force, self._devices.tracker
        begin_ns = self._now()
        end_ns = begin_ns + round(seconds * 1e9)
        last_ns = end_ns + round(SILENT_S * 1e9)
        while (at_ns := self._now()) < (end_ns if positions and forces else last_ns):
            axis.request(at_ns)
            positions += [sample.position_mm for sample in axis.poll(at_ns) if sample.capture_ns >= begin_ns]
            forces += [sample[4:7] for sample in force.poll(at_ns) if sample.valid and sample.capture_ns >= begin_ns]
            frames = tracker.poll(at_ns) if tracker else []
            markers += [sample for sample in frames if sample.valid and sample.capture_ns >= begin_ns]
            self._sleep(PERIOD_S)
        if not positions or not forces:
            raise DeviceError(
                f"{len(positions)} samples of the axis and {len(forces)} of force came in {seconds + SILENT_S:g} s"
            )
        return float(np.mean(positions)), markers, np.mean(forces, axis=0)


def _places(markers: Sequence[MarkerSample], tool: int) -> Array:
    found = [(sample.x_mm, sample.y_mm, sample.z_mm) for sample in markers if sample.tool == tool]
    return np.array(found, dtype=float).reshape(-1, 3)


def steps_mm(from_mm: float, to_mm: float, count: int) -> list[float]:
    """Places up in ``count`` even steps, and down again by the same: what the way back adds is seen."""
    up = np.linspace(from_mm, to_mm, count + 1).tolist()
    return [*up, *up[-2::-1]]


def drive_to_positions(axis: RestingAxis, positions_mm: Iterable[float]) -> list[Place]:
    """Where it stands, then ``positions_mm``; CheckFailed with the first step where scale or sense is wrong."""
    places = [_seen(axis.place())]
    checked = False
    for position_mm in positions_mm:
        axis.go(position_mm)
        places.append(_seen(axis.place()))
        if not checked and abs(places[-1].axis_mm - places[0].axis_mm) >= FIRST_STEP_MM:
            refuse_first_step(places[0], places[-1])
            known_direction(ahead_mm(places))
            checked = True
    return places


def _seen(place: Place) -> Place:
    if not len(place.tip_mm):
        raise CheckFailed(f"the tip's marker is not seen at {place.axis_mm:.2f} mm: bring it into the tracker's view")
    return place


def touches_mm(axis: RestingAxis, near_mm: float, count: int = TOUCHES) -> list[float]:
    """Axis positions at which the load passes 0.3 N, ``count`` times from ``near_mm`` on; backs off after each."""
    return [_touch_mm(axis, near_mm) for _ in range(count)]


def _touch_mm(axis: RestingAxis, near_mm: float) -> float:
    axis.go(near_mm)
    before_mm, before_N = axis.load_N()
    if before_N > CONTACT_N:
        raise CheckFailed(
            f"{before_N:.2g} N on the tip at {before_mm:.2f} mm already: begin farther out, give --near-mm"
        )
    for step in range(1, round(SEARCH_MM / STEP_MM) + 1):
        axis.go(near_mm + step * STEP_MM)
        now_mm, now_N = axis.load_N()
        if now_N > CONTACT_N:
            axis.go(near_mm - BACK_MM)
            return before_mm + (CONTACT_N - before_N) / (now_N - before_N) * (now_mm - before_mm)
        before_mm, before_N = now_mm, now_N
    raise CheckFailed(
        f"no contact from {near_mm:g} to {near_mm + SEARCH_MM:g} mm: give --near-mm closer to it, and check"
        " axis.direction: a growing position must lead to it"
    )
