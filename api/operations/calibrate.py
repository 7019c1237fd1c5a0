"""The force sensor against known weights, and the axis against tracker or gauge block; nobody else has the bench."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import NamedTuple

from api.operations.claimed import claimed
from controller.commissioning.axis import KnownBy, against_block, against_tracker, ahead_mm, known_direction
from controller.commissioning.axis_moves import (
    BACK_MM,
    SEARCH_MM,
    RestingAxis,
    drive_to_positions,
    steps_mm,
    touches_mm,
)
from controller.commissioning.force import calibrate
from controller.commissioning.readings import read
from controller.commissioning.stoppable import awaited, stoppable
from controller.commissioning.weights import Weights
from controller.devices.drivers import Devices, open_force, start_devices
from controller.loop.realtime import promptly
from controller.operation import Operation
from rig.config.calibration import AxisCalibration, ForceCalibration
from rig.config.products.roles import ForceProduct
from rig.config.wiring import Wiring
from rig.errors import CheckFailed, UsageError

LOOK_S = 0.05
# A camera of 0.1 mm then knows the slope to a fifth of the 1 % that is allowed.
LEAST_TRAVEL_MM = 8.0
STEPS = 4


class ReadingTime(NamedTuple):
    """How long each load rests before it is read, and how long it is read.

    A weight put on by hand swings for half a second; a second of readings then averages breath and traffic.
    """

    settle_s: float = 0.5
    read_s: float = 1.0


BY_HAND = ReadingTime()


class AxisTravel(NamedTuple):
    """Where the axis begins and how far it goes, in the air."""

    from_mm: float
    to_mm: float


class GaugeBlock(NamedTuple):
    """A block of known height, and the axis position just before the table that it will lie on."""

    height_mm: float
    near_mm: float


def force_calibration_operation(weights: Weights) -> Operation:
    """The operation that ``calibrate_force`` is to report to."""
    return Operation("calibrate force", total=len(weights.sequence_N), unit="loads")


def load_request(load_N: float) -> str:
    """What a person is asked to do for it."""
    if not load_N:
        return "take every weight off the tip and let nothing touch it"
    return f"{'hang' if load_N < 0 else 'put'} {abs(load_N):.4g} N {'from' if load_N < 0 else 'on'} the tip, alone"


def calibrate_force(
    operation: Operation,
    wiring: Wiring,
    weights: Weights,
    put_on: Callable[[float], object],
    rest: ReadingTime = BY_HAND,
) -> ForceCalibration:
    """The calibration under ``weights``, each load [N] by ``put_on``; CheckFailed says what is wrong. Nothing moves."""
    with claimed(wiring, moves=False):
        return measured_force(operation, wiring.force, weights, put_on, rest)


def measured_force(
    operation: Operation, config: ForceProduct, weights: Weights, put_on: Callable[[float], object], rest: ReadingTime
) -> ForceCalibration:
    """The same for a caller who has the bench already."""
    number = count()

    def apply(load_N: float) -> None:
        operation.step(f"{load_N:g} N", next(number))
        put_on(load_N)

    with closing(open_force(config)) as sensor:
        sensor.start()
        return calibrate(
            sensor.identity,
            config,
            weights,
            apply,
            lambda: read(sensor, config.product, rest.read_s, rest.settle_s),
            datetime.now(UTC),
        )


class AxisAsked(NamedTuple):
    """What a calibration of the axis is asked for; None where a person is to be asked, or it is not wanted."""

    from_mm: float
    to_mm: float
    clear: bool
    toward_limb: bool | None
    gauge_block_mm: float | None
    near_mm: float | None

    @property
    def way(self) -> str:
        """What has to be free."""
        return "home to the block" if self.gauge_block_mm else f"home to {self.to_mm:g} mm"

    @property
    def block_request(self) -> str:
        """What a person is asked to do between the searches for table and block."""
        return f"put the gauge block of {self.gauge_block_mm:g} mm under the tip"


class AxisStart(NamedTuple):
    """Before the axis moves: ``clear`` returns once its way is free, and raises where it is not.

    ``word`` is the stop word where whoever asks has a stop process already.
    """

    clear: Callable[[], object] = lambda: None
    word: Path | None = None


AT_ONCE = AxisStart()


def refuse_axis(asked: AxisAsked, wiring: Wiring) -> None:
    """Raises UsageError, before anything is opened, for what cannot be done."""
    if asked.gauge_block_mm is None:
        refuse_travel(AxisTravel(asked.from_mm, asked.to_mm), wiring)
    elif asked.near_mm is not None:
        refuse_block(GaugeBlock(asked.gauge_block_mm, asked.near_mm), wiring)
    else:
        refuse_outside((asked.from_mm, asked.to_mm), wiring)


def refuse_travel(travel: AxisTravel, wiring: Wiring) -> None:
    """Raises UsageError, before anything is opened, for what the tracker cannot judge."""
    if wiring.tracker is None:
        raise UsageError("there is no [tracker] to compare the axis with: give --gauge-block-mm")
    refuse_outside(travel, wiring)
    if travel.to_mm - travel.from_mm < LEAST_TRAVEL_MM:
        raise UsageError(
            f"--from-mm {travel.from_mm:g} --to-mm {travel.to_mm:g}: {LEAST_TRAVEL_MM:g} mm of travel or more are"
            " needed"
        )


def refuse_block(block: GaugeBlock, wiring: Wiring) -> None:
    """Raises UsageError where the search for table and block would leave the workspace."""
    refuse_outside((block.near_mm - block.height_mm - BACK_MM, block.near_mm + SEARCH_MM), wiring)


def refuse_outside(ends_mm: tuple[float, float], wiring: Wiring) -> None:
    """Raises UsageError where an end lies outside the workspace."""
    limits = wiring.limits
    for end_mm in ends_mm:
        if not limits.position_min_mm <= end_mm <= limits.position_max_mm:
            raise UsageError(
                f"the axis would go to {end_mm:g} mm, outside {limits.position_min_mm:g} to {limits.position_max_mm:g}"
                " mm of [limits]; give --from-mm, --to-mm or --near-mm"
            )


class Resting(NamedTuple):
    """An axis at rest, its devices, what is to be around each motion, and whether a stop was asked for."""

    axis: RestingAxis
    devices: Devices
    moving: Callable[[], AbstractContextManager[None]]
    interrupted: Callable[[], bool]


@contextmanager
def resting_axis(operation: Operation, wiring: Wiring, start: AxisStart = AT_ONCE) -> Iterator[Resting]:
    """Devices started and the axis homed; a stop brakes it, and whatever happens the devices are closed.

    At the loop's priority, as the drive brakes where its heartbeat comes late.
    """
    with claimed(wiring, moves=True), stoppable(wiring, start.word) as (guard, port), promptly(wiring.loop.priority):
        if port:
            operation.say(f"stop: Ctrl-C, the foot switch, or POST http://127.0.0.1:{port}/estop")

        def look() -> None:
            guard.refuse()
            time.sleep(LOOK_S)

        awaited(start.clear, look)

        @contextmanager
        def moving() -> Iterator[None]:
            operation.refuse_cancelled("the next move")
            with guard.moving():
                yield

        with closing(start_devices(wiring, guard.interrupted)) as devices:
            with moving():
                devices.axis.home()
            axis = RestingAxis(devices, moving, refuse_stopped=guard.refuse)
            yield Resting(axis, devices, moving, guard.interrupted)


def axis_by_tracker(
    operation: Operation,
    wiring: Wiring,
    travel: AxisTravel,
    toward_limb: Callable[[], bool],
    start: AxisStart = AT_ONCE,
) -> AxisCalibration:
    """The axis against the tracker; where no marker on the limb tells it, ``toward_limb`` says where the tip went."""
    refuse_travel(travel, wiring)
    with resting_axis(operation, wiring, start) as resting:
        places = drive_to_positions(resting.axis, _told(operation, steps_mm(travel.from_mm, travel.to_mm, STEPS)))
        known_by = known_direction(ahead_mm(places)) or _said(lambda: resting.axis.wait_for(toward_limb))
    return against_tracker(resting.devices.axis.identity, wiring.axis, places, known_by, datetime.now(UTC))


def _told(operation: Operation, positions_mm: Sequence[float]) -> Iterator[float]:
    for number, position_mm in enumerate(positions_mm):
        operation.advance(number / len(positions_mm), f"{position_mm:g} mm")
        yield position_mm


def _said(toward_limb: Callable[[], bool]) -> KnownBy:
    if not toward_limb():
        raise CheckFailed("the tip went away from the limb where the position grows: turn axis.direction")
    return "operator"


def axis_by_block(
    operation: Operation,
    wiring: Wiring,
    from_mm: float,
    block: GaugeBlock,
    put: Callable[[], object],
    start: AxisStart = AT_ONCE,
) -> AxisCalibration:
    """The axis against a gauge block, which ``put`` lays on the table while the axis waits."""
    with resting_axis(operation, wiring, start) as resting:
        axis, drive = resting.axis, resting.devices.axis.identity
        axis.go(from_mm)
        axis.place()
        operation.advance(0.0, "table")
        table_mm = touches_mm(axis, block.near_mm)
        axis.go(block.near_mm - block.height_mm - BACK_MM)
        axis.wait_for(put)
        operation.advance(0.5, "block")
        block_mm = touches_mm(axis, block.near_mm - block.height_mm)
    return against_block(drive, wiring.axis, table_mm, block_mm, block.height_mm, datetime.now(UTC))
