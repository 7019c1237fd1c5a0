"""A servo axis on any CiA 402 drive: the session of the EPOS4, with objects, units and identity from a data sheet."""

import time
from collections.abc import Callable
from pathlib import Path

from drivers.can.opening import OpenLink
from drivers.cia402.eds import read_eds
from drivers.cia402.kind import SheetKind, check_sheet
from drivers.epos4.device import Epos4Axis
from drivers.epos4.walker import never
from rig.config.products.cia402 import Cia402Wiring
from rig.config.wiring import Limits

NEUTRAL = Path(__file__).parent / "neutral.eds"
"""The data sheet of the simulated drive, which is no maker's."""


def open_axis(
    config: Cia402Wiring,
    limits: Limits,
    now: Callable[[], int] = time.monotonic_ns,
    rate_Hz: float = 1000.0,
    open_link: OpenLink | None = None,
    interrupted: Callable[[], bool] = never,
) -> Epos4Axis:
    """The axis, not yet started; raises UsageError where the data sheet cannot be used."""
    path = config.eds or NEUTRAL
    sheet = read_eds(path)
    check_sheet(sheet, str(path))
    return Epos4Axis(config, limits, now, rate_Hz, open_link, interrupted, SheetKind(config, sheet))
