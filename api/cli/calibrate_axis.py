"""Guides a person through a calibration of the axis; the mock bench needs nobody, and nothing is in its way."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from api.cli.asking import Person
from api.cli.computing import here
from api.cli.mock_bench import bench_for
from api.cli.mock_calibration import NEAR_MM, block_laid
from api.cli.output import show
from api.operations.calibrate import AxisAsked, AxisTravel, GaugeBlock, axis_by_block, axis_by_tracker, refuse_axis
from controller.commissioning.refusals import refuse_unstated_scale
from controller.operation import Operation
from mock_devices.control import BenchControl
from rig.config.calibration import AxisCalibration
from rig.config.endpoints import Endpoints
from rig.config.products.roles import MOCK_PORT
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.results.tables import TextTable


def calibrate_axis(wiring: Wiring, asked: AxisAsked, person: Person) -> AxisCalibration:
    """The calibration, and what it says on the terminal; raises CheckFailed with what is wrong."""
    refuse_axis(asked, wiring)
    mock = wiring.axis.port == MOCK_PORT
    if not mock:
        refuse_unstated_scale(wiring)
        asked = _confirmed(asked, person)
        refuse_axis(asked, wiring)
        show("the axis homes and moves now")
    operation = Operation("calibrate axis")
    with bench_for(wiring, approaches=False) as (live, endpoints):
        if asked.gauge_block_mm:
            with _block(asked, person, endpoints if mock else None) as (block, put):
                found = here(operation, lambda: axis_by_block(operation, live, asked.from_mm, block, put))
        else:
            travel = AxisTravel(asked.from_mm, asked.to_mm)
            found = here(operation, lambda: axis_by_tracker(operation, live, travel, lambda: _toward(asked, person)))
    _say(found)
    return found


def _confirmed(asked: AxisAsked, person: Person) -> AxisAsked:
    """Nothing moves before somebody has said that the way is free."""
    if not asked.clear:
        person.refuse_unless_clear(asked.way)
    if asked.gauge_block_mm and asked.near_mm is None:
        said = person.answer(f"axis position {NEAR_MM:g} mm or a little more before the table, in mm", "--near-mm")
        return asked._replace(near_mm=_number(said))
    return asked


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise UsageError(f"{text!r} is no number of millimetres; give --near-mm") from error


def _toward(asked: AxisAsked, person: Person) -> bool:
    """The tracker cannot tell it without a marker on the limb."""
    if asked.toward_limb is not None:
        return asked.toward_limb
    question = "no marker on the limb tells it: did the tip first go towards the limb's place (yes or no)"
    return person.answer(question, "--toward-limb or --away-from-limb") == "yes"


@contextmanager
def _block(
    asked: AxisAsked, person: Person, endpoints: Endpoints | None
) -> Iterator[tuple[GaugeBlock, Callable[[], object]]]:
    """Where the search begins, and who puts the block there: a mock limb is its own."""
    if endpoints:
        with BenchControl(endpoints.control) as control, block_laid(control, asked) as found:
            yield found
    else:
        yield GaugeBlock(asked.gauge_block_mm or 0.0, asked.near_mm or 0.0), lambda: person.do(asked.block_request)


def _say(found: AxisCalibration) -> None:
    rows = [(f"{step.axis_mm:.3f}", f"{step.reference_mm:.3f}") for step in found.steps]
    show(
        TextTable("Axis and reference", ("axis (mm)", f"{found.reference} (mm)"), rows, words=0),
        f"{found.product} {found.serial}: 1 mm of the axis is {found.scale:.4f} +- {found.uncertainty:.4f} mm of the"
        f" {found.reference}; that it leads to the limb is known by the {found.direction_known_by}",
    )
