"""Guides a person through a force calibration; the mock bench puts weights on its own tip instead."""

from typing import Literal, NamedTuple

from api.cli.asking import Person
from api.cli.computing import here
from api.cli.mock_bench import bench_for
from api.cli.mock_calibration import BY_ITSELF, mock_weights, weights_on
from api.cli.output import show
from api.operations.calibrate import calibrate_force as measure
from api.operations.calibrate import force_calibration_operation, load_request
from controller.commissioning.weights import Weights, parse_weights
from mock_devices.control import BenchControl
from rig.config.calibration import ForceCalibration
from rig.config.force_map import CHANNELS
from rig.config.products.roles import MOCK_PORT
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.results.tables import TextTable

Load = Literal["pressed", "hung"]


class ForceAsked(NamedTuple):
    """What `rig calibrate force` was asked for; empty and None where it is to be asked."""

    weights: str
    load: Load | None
    tolerance: float
    gravity_m_s2: float | None


def calibrate_force(wiring: Wiring, asked: ForceAsked, person: Person) -> ForceCalibration:
    """The calibration, and what it says on the terminal; raises CheckFailed with what is wrong."""
    if wiring.force.port == MOCK_PORT:
        weights = _weights(wiring, asked, person) if asked.weights else mock_weights(wiring, asked.load == "hung")
        operation = force_calibration_operation(weights)
        with bench_for(wiring, approaches=False) as (live, endpoints):
            assert endpoints
            with BenchControl(endpoints.control) as control, weights_on(control) as put_on:
                found = here(operation, lambda: measure(operation, live, weights, put_on, BY_ITSELF))
    else:
        weights = _weights(wiring, asked, person)
        operation = force_calibration_operation(weights)
        found = here(operation, lambda: measure(operation, wiring, weights, lambda N: person.do(load_request(N))))
    _say(found)
    return found


def _weights(wiring: Wiring, asked: ForceAsked, person: Person) -> Weights:
    """From the options; what they leave open is asked for."""
    text = asked.weights or person.answer("which weights will you use, for example 100 g,200 g,500 g", "--weights")
    load = asked.load
    if load is None and wiring.force.port != MOCK_PORT:
        said = person.answer("do they press on the tip or hang from it (pressed or hung)", "--load pressed or hung")
        if said not in ("pressed", "hung"):
            raise UsageError(f"{said!r}: answer pressed or hung, or give --load")
        load = "hung" if said == "hung" else "pressed"
    return parse_weights(text, load == "hung", asked.tolerance, wiring.limits.force_N, asked.gravity_m_s2)


def _say(found: ForceCalibration) -> None:
    rows = [(f"{load.load_N:.3f}", *(f"{value:.3f}" for value in load.force_N)) for load in found.loads]
    sure, largest_N = found.uncertainty, max(abs(load.load_N) for load in found.loads)
    at = CHANNELS.index(found.channel)
    show(
        TextTable("Known loads and readings", ("load (N)", *(f"{name} (N)" for name in CHANNELS)), rows, words=0),
        f"{found.product} {found.serial}: compression is {found.compression} on {found.channel},"
        f" corrected by {found.matrix[at][at]:.4f}",
        f"noise {found.noise_N[at]:.4f} N rms; standard uncertainty {100 * sure.combined:.2g} % at {largest_N:.4g} N"
        f" (repeatability {100 * sure.repeatability:.2g}, weights {100 * sure.weights:.2g},"
        f" linearity {100 * sure.linearity:.2g})",
    )
