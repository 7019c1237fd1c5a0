"""A recording while it is written piece by piece, and what the session lists of it."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.channels import AXIS, BY_NAME, FORCE
from rig.errors import DataError
from rig.intake.folder import FoundTable
from rig.intake.rows import FIELDS, Piece, stream_rows
from rig.recording.mcap_file import SUMMARY, RecordingWriter
from rig.recording.reader import LONGEST_ROWS, NUMERIC, Recording
from rig.recording.sessions import TrialInfo

# Fewer rows tell no rate.
FEWEST_ROWS = 2


@dataclass(frozen=True)
class Written:
    """A finished recording: what is listed of it, span, hash of its rows, remarks, and itself if not too long."""

    info: TrialInfo
    span_ns: tuple[int, int]
    digest: bytes
    remarks: tuple[str, ...]
    recording: Recording | None = None


class OpenRecording:
    """A recording being written; ``info`` is what is known of it so far."""

    def __init__(
        self, folder: Path, info: TrialInfo, metadata: Mapping[str, Mapping[str, str]], known: Sequence[str] = ()
    ) -> None:
        """Creates its file in ``folder``; ``known`` are remarks from before it is written."""
        self.info = info
        self._known = known
        self._metadata = metadata
        self._writer = RecordingWriter(folder / info.file, metadata)
        self._rows: dict[str, list[NDArray[np.void]]] = {}
        self._last: dict[str, NDArray[np.void]] = {}
        self._sources: dict[str, str] = {}
        self._seen = hashlib.sha256()
        self._span_ns: list[int] = []
        self._saturated = self._dropped = 0
        self._left_out: dict[str, int] = {}

    def add(self, piece: Piece, table: FoundTable) -> None:
        """Appends a piece; raises DataError where a stream was there before."""
        self._saturated += piece.saturated
        self._dropped += piece.dropped
        if not piece.at_ns.size:
            return
        for stream, rows in stream_rows(piece, self._last).items():
            if self._sources.setdefault(stream, table.sheet.where) != table.sheet.where:
                twice = f"{table.sheet.where}: {stream} of recording {self.info.name} was there before"
                raise DataError(f"{twice}; name what tells the two apart in `recording`")
            self._left_out[stream] = self._left_out.get(stream, 0) + piece.dropped
            self._write(stream, rows)

    def _write(self, stream: str, rows: NDArray[np.void]) -> None:
        self._writer.add_rows(BY_NAME[stream], rows)
        for field in ("capture_ns", *FIELDS[stream].values()):
            self._seen.update(np.ascontiguousarray(rows[field]).data)
        self._last[stream] = rows[-1:].copy()
        self._rows.setdefault(stream, []).append(rows)
        span_ns = [*self._span_ns, int(rows[0]["capture_ns"]), int(rows[-1]["capture_ns"])]
        self._span_ns = [min(span_ns), max(span_ns)]
        samples = {**self.info.samples, stream: self.info.samples.get(stream, 0) + rows.size}
        if sum(samples.values()) > LONGEST_ROWS:
            self._rows = {}
        peak_N = self.info.peak_force_N
        if stream == FORCE.name:  # the largest in size, with its sign: a strip that is pulled has only negative ones
            ends_N = np.array([peak_N, np.fmax.reduce(rows["fz_N"]), np.fmin.reduce(rows["fz_N"])])
            peak_N = float(ends_N[np.argmax(np.nan_to_num(np.abs(ends_N), nan=-1.0))])
        self.info = replace(self.info, samples=samples, peak_force_N=peak_N)

    def finish(self) -> Written:
        """Closes the file; raises DataError where it holds too little."""
        samples, name = self.info.samples, self.info.name
        if min(samples.values(), default=0) < FEWEST_ROWS:
            found = "only one row" if samples else "no row"
            raise DataError(f"recording {name}: {found} under the header; a stream needs at least {FEWEST_ROWS}")
        counts = {"samples": json.dumps(samples), "left_out": json.dumps(self._left_out)}
        summary = {"outcome": self.info.outcome, **counts}
        self._writer.finish(summary)
        first, last = self._span_ns
        return Written(self.info, (first, last), self._seen.digest(), tuple(self._remarks()), self._recording(summary))

    def _recording(self, summary: Mapping[str, str]) -> Recording | None:
        if sum(self.info.samples.values()) > LONGEST_ROWS:
            return None
        metadata = {name: dict(values) for name, values in {**self._metadata, SUMMARY: summary}.items()}
        parts = {own.name: self._rows.get(own.name, [np.zeros(0, own.dtype)]) for own in NUMERIC}
        tables = {name: own[0] if len(own) == 1 else np.concatenate(own) for name, own in parts.items()}
        return Recording(self._writer.path, metadata, tables, (), complete=True, damage=())

    def _remarks(self) -> list[str]:
        counts = {
            "at the end of the range, marked not valid": self._saturated,
            "out of order in time, left out": self._dropped,
        }
        said = [f"{self.info.name}: {count} samples {what}" for what, count in counts.items() if count]
        absent = [stream.name for stream in (FORCE, AXIS) if stream.name not in self.info.samples]
        return [*self._known, *said, *(f"{self.info.name}: holds no {stream}" for stream in absent)]

    def close(self) -> None:
        """Lets go of the file as it is."""
        self._writer.close()
