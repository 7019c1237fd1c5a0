"""Guides a person through the identification of the axis; of the mock bench it needs nobody."""

from api.cli.asking import Person
from api.cli.computing import here
from api.cli.mock_bench import bench_for
from api.cli.mock_calibration import in_the_air
from api.cli.output import show
from api.operations.calibrate_dynamics import axis_dynamics, sweep_asked, sweep_way
from controller.commissioning.refusals import refuse_unstated_scale
from controller.operation import Operation
from mock_devices.control import BenchControl
from rig.config.axis_dynamics import AxisDynamics
from rig.config.products.roles import MOCK_PORT
from rig.config.wiring import Wiring
from rig.results.tables import TextTable


def calibrate_dynamics(wiring: Wiring, from_mm: float, clear: bool, person: Person) -> AxisDynamics:
    """The dynamics, and what they say on the terminal; raises CheckFailed with what is wrong."""
    sweep = sweep_asked(wiring, from_mm)
    if wiring.axis.port != MOCK_PORT:
        refuse_unstated_scale(wiring)
        if not clear:
            person.refuse_unless_clear(sweep_way(sweep, from_mm))
        show("the axis homes and moves now")
    found = _identified(wiring, from_mm)
    _say(found)
    return found


def _identified(wiring: Wiring, from_mm: float) -> AxisDynamics:
    operation = Operation("calibrate axis --dynamics")
    with bench_for(wiring, approaches=False) as (live, endpoints):
        if endpoints is None or wiring.axis.port != MOCK_PORT:
            return here(operation, lambda: axis_dynamics(operation, live, from_mm))
        with BenchControl(endpoints.control) as control, in_the_air(control):
            return here(operation, lambda: axis_dynamics(operation, live, from_mm))


def _say(found: AxisDynamics) -> None:
    turn, current = found.reversal, "not told by the drive"
    if turn.friction_A is not None:
        current = f"{turn.friction_A:.3f} +- {turn.friction_within_A:.3f} A"
    rows = [
        ("delay", str(found.delay)),
        ("first lag", str(found.lag1)),
        ("second lag", str(found.lag2)),
        ("delay and lags", str(found.total)),
        ("lost where it turns", f"{1e3 * turn.lost_mm:.1f} +- {1e3 * turn.lost_within_mm:.1f} um"),
        ("current of dry friction", current),
        ("set-point held", f"{1e3 * found.hold_s:.2f} ms (from the loop's rate)"),
        ("force sensor's filter", f"{1e3 * found.force_filter_s:.2f} ms (declared)"),
        ("age of its newest sample", f"{1e3 * found.force_age_s:.2f} ms (capture times)"),
    ]
    show(
        TextTable("How the axis follows its set-point", ("what", "95 %"), rows, words=2),
        f"{found.product} {found.serial} at {found.rate_Hz:g} Hz on {found.computer}: gain {found.gain:.3f}, coherence"
        f" {found.coherence:.2f} or more, {100 * found.misfit:.1f} % off a delay and two lags"
        f" ({found.lowest_Hz:g} to {found.highest_Hz:g} Hz)",
    )
