"""Samples of one input for whoever watches it: by its own driver, or out of the ring of a bench that runs."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

from controller.inputs.runner import open_input
from drivers.input_role import Input
from rig.channels import Stream
from rig.config.products.input_role import InputProduct
from rig.errors import DeviceError
from rig.recording.slots import rows_of
from rig.recording.tap import RingTap

PERIOD_S = 0.01
AT_ONCE = 4096
# A person who presses does so every few seconds; an input that says nothing at all for so long is gone.
SILENT_S = 5.0
Row = tuple[int | float, ...]


def by_driver(config: InputProduct, goes_on: Callable[[], bool]) -> Iterator[Row]:
    """Rows of an input that nobody else uses; raises DeviceError where it is lost."""
    with closing(open_input(config)) as device:
        device.start()
        yield from _driven(device, goes_on)


def _driven(device: Input, goes_on: Callable[[], bool]) -> Iterator[Row]:
    heard_ns = time.monotonic_ns()
    while goes_on():
        now_ns = time.monotonic_ns()
        for sample in device.poll(now_ns):
            heard_ns = now_ns
            yield sample.row
        _refuse_silence(now_ns - heard_ns)
        time.sleep(PERIOD_S)


def by_ring(ring: Path, stream: Stream, goes_on: Callable[[], bool]) -> Iterator[Row]:
    """Rows of an input of the bench whose loop publishes in ``ring``, from now on."""
    with closing(RingTap.open(ring)) as tap:
        tap.position = tap.head
        heard_ns = time.monotonic_ns()
        while goes_on():
            now_ns = time.monotonic_ns()
            for row in rows_of(tap.take(AT_ONCE), stream).tolist():
                heard_ns = now_ns
                yield row
            _refuse_silence(now_ns - heard_ns)
            time.sleep(PERIOD_S)


def _refuse_silence(silent_ns: int) -> None:
    if silent_ns > SILENT_S * 1e9:
        raise DeviceError(f"no sample of the input for {SILENT_S:g} s; `rig doctor` says how it is")
