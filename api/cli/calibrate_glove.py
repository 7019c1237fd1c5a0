"""Guides a person through the calibration of a glove; the mock bench puts weights on its own glove instead."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from api.cli.asking import Person
from api.cli.computing import here
from api.cli.mock_bench import bench_for
from api.cli.mock_calibration import BY_ITSELF
from api.cli.options import wiring_file
from api.cli.output import show, write_json
from api.operations.calibrations import keep_glove
from api.operations.glove import HEAVIEST_N, calibration_operation, finger_request
from api.operations.glove import calibrate_glove as measure
from controller.commissioning.weights import Weights, parse_weights
from controller.experiments.glove import glove_of
from mock_devices.control import BenchControl
from rig.config.glove import GloveCalibration
from rig.config.products.firmata_glove import FirmataGlove
from rig.config.products.roles import MOCK_PORT
from rig.config.wiring import Wiring
from rig.results.glove import GloveCalibrated
from rig.results.tables import TextTable

MOCK_WEIGHTS = Weights((1.0, 2.0, 4.0, 7.0, 10.0), uncertainty=0.0)
# Ten samples of a glove at 50 Hz.
MOCK_REST = BY_ITSELF._replace(read_s=0.2)


class GloveAsked(NamedTuple):
    """What `rig calibrate glove` was asked for; ``weights`` is empty where it is to be asked."""

    weights: str
    tolerance: float
    gravity_m_s2: float | None
    input: str


def calibrate_glove(wiring: Wiring, asked: GloveAsked, person: Person) -> tuple[str, GloveCalibration]:
    """The glove's name and its calibration; raises CheckFailed with what is wrong."""
    name, glove = glove_of(wiring, asked.input)
    weights = MOCK_WEIGHTS if glove.port == MOCK_PORT and not asked.weights else _weights(asked, person)
    operation = calibration_operation(glove, weights)
    if glove.port == MOCK_PORT:
        with bench_for(wiring, approaches=False) as (live, endpoints):
            assert endpoints
            with BenchControl(endpoints.control) as control:
                put_on = weights_on_glove(control, glove)
                found = here(operation, lambda: measure(operation, live, name, weights, put_on, MOCK_REST))
    else:

        def ask(finger: str, load_N: float) -> None:
            person.do(finger_request(finger, load_N))

        found = here(operation, lambda: measure(operation, wiring, name, weights, ask))
    _say(found)
    return name, found


def _weights(asked: GloveAsked, person: Person) -> Weights:
    text = asked.weights or person.answer("which weights will you use, for example 100 g,500 g,1 kg", "--weights")
    return parse_weights(text, False, asked.tolerance, HEAVIEST_N, asked.gravity_m_s2)


def weights_on_glove(control: BenchControl, glove: FirmataGlove) -> Callable[[str, float], None]:
    """What puts weights on the fingers of the mock bench's glove."""

    def put_on(finger: str, load_N: float) -> None:
        control.fault("glove", "weight", f"{tuple(glove.fingers).index(finger)}={load_N!r}")

    return put_on


def _say(found: GloveCalibration) -> None:
    rows = [
        (finger, f"{load_N:.3f}", f"{counts:.1f}")
        for finger, known in found.fingers.items()
        for load_N, counts in zip(known.loads_N, known.counts, strict=True)
    ]
    show(TextTable("Known loads and readings", ("finger", "load (N)", "counts"), rows, words=1))


def keep_and_say(name: str, found: GloveCalibration, out: Path | None, config: Path | None, json: Path | None) -> None:
    """Writes it, and says which lines of the wiring file use it."""
    path = keep_glove(found, out)
    named = os.path.relpath(path, (wiring_file(config) or Path()).parent)
    show(f"written: {path}; the lines of rig.toml that use it:", f'[input.{name}]\ncalibration = "{named}"')
    write_json(json, GloveCalibrated(file=str(path), calibration=found))
