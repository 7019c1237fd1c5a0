"""What a session's streams are made of, those of its inputs included, for exports that carry it along."""

from collections.abc import Iterable

from rig.channels import BY_NAME, Stream
from rig.recording.sessions import Session


def streams_in(session: Session) -> tuple[Stream, ...]:
    """Those of the bench, and of inputs that a recording has samples of."""
    more = (session.recording(trial.name) for trial in session.trials if not trial.samples.keys() <= BY_NAME.keys())
    return tuple((BY_NAME | {stream.name: stream for recording in more for stream in recording.streams}).values())


def legend(streams: Iterable[Stream]) -> str:
    """Stream, column, unit and meaning, as CSV."""
    extra = [
        'force,force_N,N,"force in compression, by the calibration, before any zero"',
        '*,time_s,s,"capture_ns in seconds"',
    ]
    lines = [
        f'{stream.name},{name},{unit},"{meaning}"'
        for stream in streams
        for name, (unit, meaning) in stream.units.items()
    ]
    return "\n".join(["stream,column,unit,meaning", *extra, *lines]) + "\n"


def units(streams: Iterable[Stream]) -> dict[str, dict[str, str]]:
    """Unit by stream and field."""
    return {stream.name: {name: unit for name, (unit, _) in stream.units.items()} for stream in streams}
