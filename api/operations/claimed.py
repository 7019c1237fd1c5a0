"""The bench for one operation that has no loop: nobody else uses its ports meanwhile."""

from collections.abc import Iterator
from contextlib import contextmanager

from controller.claims import take
from rig.config.wiring import Wiring
from rig.errors import UsageError


@contextmanager
def claimed(wiring: Wiring, moves: bool) -> Iterator[None]:
    """Takes the ports; DeviceError names who has one, UsageError where it ``moves`` and the tip may be in tissue."""
    claim = take(wiring)
    try:
        if moves and claim.unfinished:
            raise UsageError(f"{claim.unfinished}: run `rig reset` first")
        yield
    finally:
        claim.release()
