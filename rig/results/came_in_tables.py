"""What came in, in tables and sentences, and as CSV: once, for terminal, HTML and file alike."""

import csv
import io
from collections.abc import Iterable, Iterator

from rig.results.came_in import CameInResult, RecordingIn, StreamIn, Use
from rig.results.tables import UNKNOWN, Caution, Part, TextTable, render

# What a screen takes; the rest is in the files.
SHORT_ROWS, SHORT_REASONS = 25, 5
HEADER = (
    "recording", "rate (Hz)", "gaps", "noise (N)", "full (%)", "contact (mm)", "cycles", "quality", "fit", "diagnose",
)  # fmt: skip
STREAMS = {
    "samples": "samples:d", "missing": "missing:d", "left out": "left_out:d", "span (s)": "span_s:.4g",
    "rate (Hz)": "rate_Hz:.4g", "lowest (Hz)": "lowest_rate_Hz:.4g", "gaps": "gaps:d",
    "longest (s)": "longest_gap_s:.3g", "from": "lowest:.4g", "to": "highest:.4g", "noise": "noise:.2g",
    "step": "resolution:.2g", "repeats": "longest_repeat:d",
}  # fmt: skip


def short_parts(result: CameInResult) -> Iterator[Part]:
    """What a terminal shows after an import."""
    chosen, said = result.shown(SHORT_ROWS)
    yield from map(Caution, result.remarks)
    yield overview(chosen, "What came in")
    if said:
        yield f"shown are {said}"
    lines = list(sentences(result.recordings))
    yield from lines[:SHORT_REASONS]
    if len(lines) > SHORT_REASONS:
        yield Caution(f"and {len(lines) - SHORT_REASONS} more such lines in the table and the report")


def whole_parts(result: CameInResult) -> Iterator[Part]:
    """What a page shows first."""
    yield from map(Caution, result.remarks)
    yield overview(result.recordings, "")


def overview(recordings: Iterable[RecordingIn], title: str) -> TextTable:
    """One row a recording: force, contact, how good it is, and which later step takes it."""
    return TextTable(title, HEADER, [_row(recording) for recording in recordings])


def _row(recording: RecordingIn) -> list[str]:
    force = recording.stream("force") or recording.stream("axis")
    numbers = [UNKNOWN] * 4 if force is None else _force_cells(force)
    taken = [use_words(recording.fit), use_words(recording.diagnose)]
    return [recording.name, *numbers, contact_words(recording), str(len(recording.cycles)), recording.quality, *taken]


def _force_cells(force: StreamIn) -> list[str]:
    own = force.stream == "force"
    return [
        render(force.rate_Hz, ".4g"),
        str(force.gaps),
        render(force.noise if own else None, ".2g"),
        f"{100 * force.saturated:.2g}" if own else UNKNOWN,
    ]


def contact_words(recording: RecordingIn) -> str:
    """Position of the first surface found with half of its interval."""
    for cycle in recording.cycles:
        if cycle.contact_mm is not None and cycle.contact_low_mm is not None and cycle.contact_high_mm is not None:
            reach_mm = max(cycle.contact_mm - cycle.contact_low_mm, cycle.contact_high_mm - cycle.contact_mm)
            return f"{cycle.contact_mm:.4g} ± {reach_mm:.2g}"
    return UNKNOWN


def use_words(use: Use) -> str:
    """Yes, no, or partly."""
    return ("partly" if use.why else "yes") if use.used else "no"


def sentences(recordings: Iterable[RecordingIn]) -> Iterator[Part]:
    """Of each recording what is to be said; what holds of several alike is said once."""
    said: dict[tuple[str, str], list[str]] = {}
    for recording in recordings:
        for label, why in _said(recording):
            said.setdefault((label, why.removeprefix(f"{recording.name}: ")), []).append(recording.name)
    for (label, why), names in sorted(said.items(), key=lambda item: -len(item[1])):
        more = f" (and {len(names) - 1} more)" if len(names) > 1 else ""
        yield Caution(f"{names[0]}{more}: {label}{why}")


def _said(recording: RecordingIn) -> Iterator[tuple[str, str]]:
    yield from (("", reason) for reason in recording.reasons)
    yield from (("", f"{stream} {found.sentence}") for stream, found in recording.alignments.items())
    for label, use in (("fit: ", recording.fit), ("diagnose: ", recording.diagnose)):
        if use.why and use.why not in recording.reasons and use.why != "; ".join(recording.reasons):
            yield label, use.why


def stream_table(result: CameInResult) -> TextTable:
    """One row a stream of a recording."""
    forms, rows = [text.partition(":") for text in STREAMS.values()], list[list[str]]()
    for recording, stream in ((one, stream) for one in result.recordings for stream in one.streams):
        cells = [render(getattr(stream, name), form) for name, _, form in forms]
        ends = ", ".join(f"{end:g}" for end in stream.saturated_at)
        full = f"{100 * stream.saturated:.2g} at {ends}" if ends else "0"
        rows.append([recording.name, f"{stream.stream} ({stream.unit})", *cells, stream.noise_from, full])
    return TextTable("", ["recording", "stream", *STREAMS, "noise from", "full (%)"], rows, words=2)


def as_csv(result: CameInResult) -> str:
    """One row a stream of a recording: what is known of the stream, then of the recording."""
    rows = [_known(recording, stream) for recording in result.recordings for stream in recording.streams]
    out = io.StringIO()
    writer = csv.DictWriter(out, rows[0] if rows else ["recording"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def _known(recording: RecordingIn, stream: StreamIn) -> dict[str, object]:
    first = next((cycle for cycle in recording.cycles if not cycle.refused), None)
    ends = " ".join(f"{end:g}" for end in stream.saturated_at)
    contact = {f"contact{end}_mm": getattr(first, f"contact{end}_mm", None) for end in ("", "_low", "_high")}
    return {
        "recording": recording.name, **stream.model_dump(), "saturated_at": ends, "one_clock": recording.one_clock,
        **contact, "cycles": len(recording.cycles), "quality": recording.quality, "fit": use_words(recording.fit),
        "diagnose": use_words(recording.diagnose), "reasons": "; ".join(recording.reasons),
    }  # fmt: skip
