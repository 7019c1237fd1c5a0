"""What came in as a part of the report, and as files of the session it came into."""

from dataclasses import dataclass

from rig.progress import Progress, silent
from rig.recording.files import write_text
from rig.recording.sessions import Session
from rig.report.came_in_figure import came_in_figure
from rig.report.ink import inlined, saved_figures
from rig.report.markup import details, figure, paragraph, parts, section, table
from rig.results.came_in import FILE, NAME, TABLE, CameInResult
from rig.results.came_in_tables import SHORT_REASONS, as_csv, sentences, stream_table, whole_parts
from rig.results.incoming import Looked, came_in_result

TITLE = "What came in"
CAPTION = (
    "Force over time and over depth as it was understood: compression upwards, into the tissue to the right; contact "
    "with its interval, samples at the end of the range and gaps are marked."
)


@dataclass(frozen=True)
class CameIn:
    """What is known of a session's recordings, and its picture as SVG; empty where nothing can be drawn."""

    result: CameInResult
    picture: str


def look_at(session: Session, tell: Progress = silent, looked: Looked | None = None) -> CameIn:
    """What came in with the session, of which each recording is read once, and none that was ``looked`` at before."""
    looked = looked or Looked()
    result = came_in_result(session, tell, looked)
    return CameIn(result, came_in_figure(result, {name: seen.trace for name, seen in looked.seen.items()}))


def save_came_in(session: Session, found: CameIn) -> None:
    """Writes JSON, CSV and the picture into the session's folder."""
    found.result.write(session.folder / FILE)
    write_text(session.folder / TABLE, as_csv(found.result))
    if found.picture:
        write_text(session.folder / f"{NAME}.svg", found.picture)


def came_in_of(session: Session, tell: Progress = silent) -> CameIn:
    """What the import left of the recordings there are; else they are looked at again, and nothing is written."""
    saved = CameInResult.read_or_why(session.folder / FILE, "", "rig import")
    pictures = saved_figures(session.folder, [NAME])
    now = {trial.name: trial.sha256 for trial in session.trials}
    if isinstance(saved, CameInResult) and saved.sha256 == now and pictures:
        return CameIn(saved, pictures[NAME])
    return look_at(session, tell)


def came_in_section(found: CameIn) -> str:
    """The part of the page."""
    picture = figure(inlined(found.picture, NAME, CAPTION), CAPTION) if found.picture else ""
    streams, said = stream_table(found.result), list(sentences(found.result.recordings))
    whole, short = parts(whole_parts(found.result)), parts(said[:SHORT_REASONS])
    return section(
        TITLE, picture, whole, short,
        details(f"{len(said) - SHORT_REASONS} more", parts(said[SHORT_REASONS:])) if len(said) > SHORT_REASONS else "",
        details("Every stream", table(streams)) if streams.rows else paragraph("No stream.", "missing"),
    )  # fmt: skip
