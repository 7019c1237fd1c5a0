"""What an operation works on: whatever a person named, opened as a session for as long as the work takes."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

from api.operations.at_hand import at_hand, refuse_store
from rig.errors import UsageError
from rig.progress import Progress
from rig.recording.sessions import Session
from rig.trials.opening import AS_IT_IS, Opening, is_session, open_place


@contextmanager
def opened(place: Path, tell: Progress, opening: Opening = AS_IT_IS) -> Iterator[Session]:
    """The session, recording or foreign files in ``place`` as a session; what is made of files lasts for the block."""
    with at_hand(place, tell) as near, TemporaryDirectory(prefix="rig-") as scratch:
        session = open_place(near, opening, Path(scratch), datetime.now().astimezone(), tell)
        yield session if near is place else replace(session, origin=place)


def results_in(place: Path, own: str, out: Path | None) -> Path:
    """``out``, else ``own`` in the session's folder; raises UsageError where the place is none to keep results in."""
    if out is None:
        refuse_store(place)
    if out is None and place.exists() and not is_session(place):
        raise UsageError(
            f"{place}: is no session, and results are not put beside others' files: give a place with --out"
        )
    return out or place / own
