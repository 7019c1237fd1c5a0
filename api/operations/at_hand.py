"""What an operation reads, as a folder or file of this computer: of an object store a copy, for as long as it works."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from rig.errors import UsageError
from rig.progress import Progress
from rig.recording.remote import Store, address_of


@contextmanager
def at_hand(place: Path, tell: Progress) -> Iterator[Path]:
    """``place``, or a copy of what lies at its address in an object store, for the block."""
    address = address_of(place)
    if address is None:
        yield place
        return
    with TemporaryDirectory(prefix="rig-") as scratch:
        yield Store(address).fetch(Path(scratch), tell)


def refuse_store(place: Path) -> None:
    """Raises UsageError where results would go to an address."""
    address = address_of(place)
    if address is not None:
        raise UsageError(f"{address}: is read, never written to: give a place for the results with --out")
