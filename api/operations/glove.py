"""A subject's pain threshold by glove, and the glove against known weights."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from datetime import UTC, datetime
from itertools import count
from pathlib import Path

from api.operations.calibrate import BY_HAND, ReadingTime
from api.operations.claimed import claimed
from controller.commissioning.glove import calibrate, read
from controller.commissioning.weights import Weights
from controller.experiments.glove import find, glove_of, keep, record, refuse_uncalibrated, stream_of
from controller.experiments.presses import PRESSES, GlovePress
from controller.experiments.tracked import refuse_foreign
from controller.inputs.runner import open_input
from controller.inputs.watch import Row, by_driver, by_ring
from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.config.glove import GloveCalibration
from rig.config.products.firmata_glove import FirmataGlove
from rig.config.wiring import Wiring
from rig.results.glove import GloveThreshold

# Beyond what fingers press with before it hurts; a sensor is calibrated no farther than its weights.
HEAVIEST_N = 50.0


def threshold_operation() -> Operation:
    """The operation that a threshold by glove is to report to."""
    return Operation("threshold by glove", total=PRESSES, unit="presses")


def check(wiring: Wiring, name: str, folder: Path) -> str:
    """The glove's name; raises UsageError, before anybody presses, where there is none or it is not calibrated."""
    found, glove = glove_of(wiring, name)
    refuse_uncalibrated(found, glove)
    refuse_foreign(folder)
    return found


def threshold_alone(operation: Operation, wiring: Wiring, name: str, folder: Path) -> GloveThreshold:
    """With the glove's own driver, where no bench runs; nobody else may use its ports."""
    with claimed(wiring, moves=False):
        rows = by_driver(wiring.input[name], lambda: not operation.cancelled)
        return _threshold(operation, wiring, name, folder, rows)


def threshold_beside(operation: Operation, bench: Supervisor, name: str, folder: Path) -> GloveThreshold:
    """With the glove of a bench that runs and has it."""
    rows = by_ring(bench.ring_path, stream_of(bench.wiring, name), lambda: not operation.cancelled)
    return _threshold(operation, bench.wiring, name, folder, rows)


def _threshold(operation: Operation, wiring: Wiring, name: str, folder: Path, rows: Iterator[Row]) -> GloveThreshold:
    seen: list[Row] = []
    outcome, presses = "failed", tuple[GlovePress, ...]()
    try:
        presses = find(operation, wiring, name, _noted(rows, seen))
        outcome = "presses"
    finally:
        file = record(seen, wiring, name, folder, outcome) if seen else None
    assert file, "presses come out of rows"
    return keep(presses, wiring, name, file)


def _noted(rows: Iterable[Row], seen: list[Row]) -> Iterator[Row]:
    for row in rows:
        seen.append(row)
        yield row


def finger_request(finger: str, load_N: float) -> str:
    """What a person is asked to do for it."""
    if not load_N:
        return f"take every weight off {finger}"
    return f"put {load_N:.4g} N on the sensor of {finger}, alone"


def calibration_operation(glove: FirmataGlove, weights: Weights) -> Operation:
    """The operation that ``calibrate_glove`` is to report to."""
    return Operation("calibrate glove", total=len(glove.fingers) * len(weights.sequence_N), unit="loads")


def calibrate_glove(
    operation: Operation,
    wiring: Wiring,
    name: str,
    weights: Weights,
    put_on: Callable[[str, float], object],
    rest: ReadingTime = BY_HAND,
) -> GloveCalibration:
    """The calibration under ``weights``, each put on a finger by ``put_on``; CheckFailed says what is wrong."""
    glove = glove_of(wiring, name)[1]
    fingers, number = tuple(glove.fingers), count()

    def apply(finger: str, load_N: float) -> None:
        operation.step(f"{finger}, {load_N:g} N", next(number))
        put_on(finger, load_N)

    with claimed(wiring, moves=False), closing(open_input(glove)) as device:
        device.start()
        return calibrate(
            device.identity,
            fingers,
            weights,
            apply,
            lambda: read(device, fingers, rest.read_s, rest.settle_s),
            datetime.now(UTC),
        )
