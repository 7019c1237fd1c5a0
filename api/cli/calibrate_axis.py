"""Guides a person through a calibration of the axis; the mock bench needs nobody, and nothing is in its way."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from typing import Any, NamedTuple

from api.cli.asking import Person
from api.cli.claimed import claimed
from api.cli.output import console, table
from api.cli.stage import bench_for
from controller.commissioning.axis import KnownBy, against_block, against_tracker, ahead_mm, known_direction
from controller.commissioning.axis_moves import BACK_MM, SEARCH_MM, RestingAxis, steps_mm, touches_mm, travelled
from controller.commissioning.stoppable import stoppable
from controller.devices.drivers import start_devices
from drivers.roles import Identity
from mock_devices.control import BenchControl
from rig.config.calibration import AxisCalibration
from rig.config.wiring import MOCK_PORT, Wiring
from rig.errors import CheckFailed, UsageError

# A camera of 0.1 mm then knows the slope to a fifth of the 1 % that is allowed.
LEAST_TRAVEL_MM = 8.0
STEPS = 4
# Half a millimetre in front of what is touched.
NEAR_MM = 0.5


class AxisAsked(NamedTuple):
    """What `rig calibrate axis` was asked for; None where it is to be asked or not wanted."""

    from_mm: float
    to_mm: float
    clear: bool
    toward_limb: bool | None
    gauge_block_mm: float | None
    near_mm: float | None


def calibrate_axis(wiring: Wiring, asked: AxisAsked, person: Person) -> AxisCalibration:
    """The calibration, and what it says on the terminal; raises CheckFailed with what is wrong."""
    _check(wiring, asked)
    if wiring.axis.port != MOCK_PORT:
        asked = _confirmed(asked, person)
        console.print("the axis homes and moves now", highlight=False)
    with bench_for(wiring, approaches=False) as (live, endpoints):
        alone = endpoints if wiring.axis.port == MOCK_PORT else {}
        found = _by_block(live, asked, person, alone) if asked.gauge_block_mm else _by_tracker(live, asked, person)
    _say(found)
    return found


def _check(wiring: Wiring, asked: AxisAsked) -> None:
    """Raises UsageError, before anything is opened, for what cannot be done."""
    limits = wiring.limits
    if asked.gauge_block_mm is None and wiring.tracker is None:
        raise UsageError("there is no [tracker] to compare the axis with: give --gauge-block-mm")
    ends_mm = (asked.from_mm, asked.to_mm)
    if asked.gauge_block_mm and asked.near_mm is not None:
        ends_mm = (asked.near_mm - asked.gauge_block_mm - BACK_MM, asked.near_mm + SEARCH_MM)
    for end_mm in ends_mm:
        if not limits.position_min_mm <= end_mm <= limits.position_max_mm:
            raise UsageError(
                f"the axis would go to {end_mm:g} mm, outside {limits.position_min_mm:g} to {limits.position_max_mm:g}"
                " mm of [limits]; give --from-mm, --to-mm or --near-mm"
            )
    if asked.gauge_block_mm is None and asked.to_mm - asked.from_mm < LEAST_TRAVEL_MM:
        raise UsageError(
            f"--from-mm {asked.from_mm:g} --to-mm {asked.to_mm:g}: {LEAST_TRAVEL_MM:g} mm of travel or more are needed"
        )


def _confirmed(asked: AxisAsked, person: Person) -> AxisAsked:
    """Nothing moves before somebody has said that the way is free."""
    if not asked.clear:
        way = "home to the block" if asked.gauge_block_mm else f"home to {asked.to_mm:g} mm"
        if person.answer(f"is the tip's way free from {way}, and the limb out (yes or no)", "--clear") != "yes":
            raise UsageError("the tip's way is not free: nothing was moved")
    if asked.gauge_block_mm and asked.near_mm is None:
        said = person.answer(f"axis position {NEAR_MM:g} mm or a little more before the table, in mm", "--near-mm")
        return asked._replace(near_mm=_number(said))
    return asked


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise UsageError(f"{text!r} is no number of millimetres; give --near-mm") from error


@contextmanager
def _resting(wiring: Wiring) -> Iterator[tuple[RestingAxis, Identity]]:
    """Devices started and the axis homed; a stop brakes it, and whatever happens the devices are closed."""
    with claimed(wiring, moves=True), stoppable(wiring) as (guard, port):
        console.print(f"stop: Ctrl-C, the foot switch, or POST http://127.0.0.1:{port}/estop", highlight=False)
        with closing(start_devices(wiring, guard.interrupted)) as devices:
            with guard.moving():
                devices.axis.home()
            yield RestingAxis(devices, guard.moving), devices.axis.identity


def _by_tracker(wiring: Wiring, asked: AxisAsked, person: Person) -> AxisCalibration:
    with _resting(wiring) as (axis, drive):
        places = travelled(axis, steps_mm(asked.from_mm, asked.to_mm, STEPS))
    known_by = known_direction(ahead_mm(places)) or _said_direction(asked, person)
    return against_tracker(drive, wiring.axis, places, known_by, datetime.now(UTC))


def _said_direction(asked: AxisAsked, person: Person) -> KnownBy:
    """The tracker cannot tell it without a marker on the limb."""
    toward = asked.toward_limb
    if toward is None:
        question = "no marker on the limb tells it: did the tip first go towards the limb's place (yes or no)"
        toward = person.answer(question, "--toward-limb or --away-from-limb") == "yes"
    if not toward:
        raise CheckFailed("the tip went away from the limb where the position grows: turn axis.direction")
    return "operator"


def _by_block(wiring: Wiring, asked: AxisAsked, person: Person, endpoints: dict[str, Any]) -> AxisCalibration:
    gauge_mm = asked.gauge_block_mm or 0.0
    with _block(person, endpoints, gauge_mm) as (known_mm, put), _resting(wiring) as (axis, drive):
        near_mm = known_mm if asked.near_mm is None else asked.near_mm
        axis.go(asked.from_mm)
        axis.place()
        table_mm = touches_mm(axis, near_mm)
        axis.go(near_mm - gauge_mm - BACK_MM)
        axis.wait_for(put)
        block_mm = touches_mm(axis, near_mm - gauge_mm)
    return against_block(drive, wiring.axis, table_mm, block_mm, gauge_mm, datetime.now(UTC))


@contextmanager
def _block(person: Person, endpoints: dict[str, Any], gauge_mm: float) -> Iterator[tuple[float, Callable[[], object]]]:
    """Where the search begins, as far as it is known, and who puts the block there: a mock limb is its own."""
    if not endpoints:
        yield 0.0, lambda: person.do(f"put the gauge block of {gauge_mm:g} mm under the tip")
        return
    with BenchControl(endpoints["control"]) as control:
        table_mm = control.number("surface.position_mm")
        yield table_mm - NEAR_MM, lambda: control.set({"surface.position_mm": table_mm - gauge_mm})


def _say(found: AxisCalibration) -> None:
    rows = [(f"{step.axis_mm:.3f}", f"{step.reference_mm:.3f}") for step in found.steps]
    console.print(table(("axis mm", f"{found.reference} mm"), rows, "Axis and reference"))
    console.print(
        f"{found.product} {found.serial}: 1 mm of the axis is {found.scale:.4f} +- {found.uncertainty:.4f} mm of the"
        f" {found.reference}; that it leads to the limb is known by the {found.direction_known_by}",
        highlight=False, markup=False, soft_wrap=True,
    )  # fmt: skip
