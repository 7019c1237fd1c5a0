"""Tables of one recording that came on clocks of their own: brought onto one, or kept apart as recordings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rig.errors import DataError
from rig.intake.folder import FoundTable
from rig.intake.lag import Array, ClocksApart, Lag, TimedSignal, lag_of_force, lag_of_motion
from rig.intake.rows import FIELDS, Piece, pieces, way_of
from rig.intake.times import Times
from rig.recording.alignment import ALIGNMENT, Alignment, By, alignment_texts

# Of the way of the motion: contact is promised to 0.2 mm of strokes of 10 mm.
WIDEST_SHARE = 0.02
FAST = 0.95  # of the samples are slower
FEWEST = 3  # samples of a channel: fewer have no rate that changes, and say nothing
PLACES = ("x", "y", "z")


@dataclass(frozen=True)
class Clock:
    """Channels of tables that share a clock, their times counted from ``base_ns``."""

    base_ns: int
    channels: Mapping[str, TimedSignal]

    @property
    def motion(self) -> TimedSignal | None:
        """What moves: a signal for this purpose, else the position, else the way a speed or a marker makes."""
        found = self.channels
        if "velocity" in found and not {"sync", "position"} & found.keys():
            return found["velocity"]._replace(value=way_of(*found["velocity"]))
        if found.keys() >= set(PLACES):
            return found.get("sync") or found.get("position") or _along(found)
        return found.get("sync") or found.get("position")


@dataclass(frozen=True)
class Part:
    """Tables that become one recording: what is added to its name, clocks by table, why one is ``apart``."""

    tables: Sequence[FoundTable]
    suffix: str = ""
    alignments: Mapping[int, Alignment] = field(default_factory=dict)
    apart: str = ""

    @property
    def streams(self) -> dict[str, Alignment]:
        """Alignments by stream."""
        return {
            stream: alignment
            for number, alignment in self.alignments.items()
            for stream in _streams(self.tables[number])
        }

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """The record of what was found between its clocks, where it has several."""
        return {ALIGNMENT: alignment_texts(self.streams)} if self.alignments else {}

    def pieces(self) -> Iterator[tuple[FoundTable, Piece]]:
        """Every piece of its tables, on one clock."""
        for number, table in enumerate(self.tables):
            for piece in pieces(table.sheet, table.form):
                yield table, move(piece, self.alignments[number]) if number in self.alignments else piece

    def remarks(self, name: str) -> list[str]:
        """What is to be said of the clocks of recording ``name``."""
        said = [f"{name}: {stream} {alignment.sentence}" for stream, alignment in self.streams.items()]
        return [*said, f"{name}: {self.apart}"] if self.apart else said


def on_one_clock(tables: Sequence[FoundTable]) -> list[Part]:
    """The tables of one recording as one, those of whose clock the data do not say enough as recordings of their own.

    Raises DataError where there is no table whose clock the others could be brought onto.
    """
    shared = [table for table in tables if table.form.clock == "shared"]
    if len(shared) == len(tables):
        return [Part(tables)]
    if not shared:
        said = f"{tables[0].sheet.where}: every table of its recording has a clock of its own"
        raise DataError(f"{said}; one must be without clock = 'own', the others are brought onto it")
    ours = _clock(shared)
    kept, alignments, parts = list(shared), dict[int, Alignment](), list[Part]()
    for table in (table for table in tables if table.form.clock == "own"):
        try:
            alignments[len(kept)] = _alignment(_clock([table]), ours, table.form.clock_within_ms)
            kept.append(table)
        except ClocksApart as reason:
            streams = "-".join(_streams(table))
            said = f"{streams} of {table.sheet.path.name} has a clock of its own and is kept apart: {reason}"
            parts.append(Part([table], f"-{streams}", apart=said))
    return [Part(kept, alignments=alignments, apart="; ".join(part.apart for part in parts)), *parts]


def move(piece: Piece, alignment: Alignment) -> Piece:
    """The piece with its times on the other clock."""
    drifted = 1e-6 * alignment.drift_ppm * (piece.at_ns - round(alignment.at_s * 1e9))
    return piece._replace(at_ns=piece.at_ns + round(alignment.offset_s * 1e9) + np.round(drifted).astype(np.int64))


def _streams(table: FoundTable) -> list[str]:
    return [stream for stream, fields in FIELDS.items() if fields.keys() & table.form.columns.keys()]


def _clock(tables: Sequence[FoundTable]) -> Clock:
    found: dict[str, list[tuple[Times, Array]]] = {}
    for table in tables:
        for piece in pieces(table.sheet, table.form):
            for quantity, values in piece.values.items():
                if quantity in ("force", "position", "velocity", "sync", *PLACES):
                    found.setdefault(quantity, []).append((piece.at_ns, values))
    base_ns = min((int(parts[0][0][0]) for parts in found.values() if parts[0][0].size), default=0)
    signals = {name: _signal(parts, base_ns) for name, parts in found.items()}
    return Clock(base_ns, {name: signal for name, signal in signals.items() if len(signal.time_s) >= FEWEST})


def _signal(parts: Sequence[tuple[Times, Array]], base_ns: int) -> TimedSignal:
    at_ns, value = np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
    sound = np.isfinite(value)
    return TimedSignal((at_ns[sound] - base_ns) * 1e-9, value[sound])


def _along(channels: Mapping[str, TimedSignal]) -> TimedSignal:
    """The marker's place along the line on which it moves most."""
    places = np.stack([channels[name].value for name in PLACES], axis=1)
    line = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)[2][0]
    return TimedSignal(channels["x"].time_s, np.asarray(places @ line))


def _alignment(theirs: Clock, ours: Clock, within_ms: float | None) -> Alignment:
    """What brings ``theirs`` onto ``ours``; raises ClocksApart."""
    by, lag, motion = _lag(theirs, ours)
    speed = np.abs(np.diff(motion.value) / np.diff(motion.time_s))
    bound_s = WIDEST_SHARE * float(np.ptp(motion.value)) / max(float(np.quantile(speed, FAST)), 1e-300)
    limit_s = bound_s if within_ms is None else 1e-3 * within_ms
    if lag.anywhere_s > limit_s:
        wanted = f"2 % of the way takes {1e3 * limit_s:.2g} ms" if within_ms is None else f"{within_ms:g} ms are wanted"
        raise ClocksApart(
            f"the {by} leave its offset open within {1e3 * lag.anywhere_s:.2g} ms, and {wanted}; if that is enough, "
            f"state clock_within_ms = {float(f'{1.05e3 * lag.anywhere_s:.2g}'):g}"
        )
    return Alignment(
        by=by, offset_s=(ours.base_ns - theirs.base_ns) * 1e-9 + lag.offset_s, within_s=lag.within_s,
        anywhere_s=lag.anywhere_s, drift_ppm=1e6 * lag.drift, drift_within_ppm=1e6 * lag.drift_within,
        at_s=theirs.base_ns * 1e-9 + lag.at_s,
    )  # fmt: skip


def _lag(theirs: Clock, ours: Clock) -> tuple[By, Lag, TimedSignal]:
    """How it was found, what is added to their times, and the motion it was found by."""
    if theirs.motion and ours.motion:
        return "correlation", lag_of_motion(theirs.motion, ours.motion), ours.motion
    if "force" in theirs.channels and ours.motion:
        return "events", lag_of_force(theirs.channels["force"], ours.motion), ours.motion
    if "force" in ours.channels and theirs.motion:
        lag = lag_of_force(ours.channels["force"], theirs.motion)
        turned = lag._replace(offset_s=-lag.offset_s, drift=-lag.drift, at_s=lag.at_s + lag.offset_s)
        return "events", turned, theirs.motion
    raise ClocksApart(
        "neither a motion nor a force of it can be compared with the other clock; name a column of both that follows "
        "the same thing, in any unit: columns.sync = { column = 'NAME' }"
    )
