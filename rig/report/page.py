"""One self-contained page about a session: everything a person would be shown, nothing loaded from outside."""

from pathlib import Path
from string import Template

from rig.errors import UsageError
from rig.progress import Progress, silent
from rig.recording.files import write_text
from rig.recording.sessions import Session
from rig.report.facts import Facts, gather
from rig.report.markup import paragraph, text
from rig.report.sections import diagnosed, headline, key_figures, sections, simulated
from rig.version import SOFTWARE

TEMPLATE = Path(__file__).with_name("page.html")


def write_report(session: Session, out: Path, tell: Progress = silent, results: Path | None = None) -> Facts:
    """Writes the report on ``session`` to ``out``, whole or not at all; what it shows.

    ``results`` is the folder that fit, diagnosis and tracking were left in, else the session's own. Raises UsageError
    where ``out`` lies in no folder.
    """
    if not out.parent.is_dir():
        raise UsageError(f"{out}: its folder does not exist; make it, or give another --out")
    facts = gather(session, results or session.folder, tell)
    tell("drawing", 0.9)
    found = page(facts)
    tell(f"writing {out.name}", 1.0)
    write_text(out, found)
    return facts


def page(facts: Facts) -> str:
    """The whole page as HTML."""
    info = facts.session.info
    subject = ", ".join(str(value) for value in (info.subject.get("id"), info.subject.get("site")) if value)
    head = [
        paragraph(" · ".join(part for part in (info.id, info.created[:16].replace("T", " "), subject) if part), "over"),
        f"<h1>{text(headline(facts))}</h1>",
        diagnosed(facts),
        simulated(facts),
        key_figures(facts),
    ]
    foot = f"<footer>{text(f'Recorded by {info.software}; report by {SOFTWARE}.')}</footer>"
    body = "\n".join([*head, *sections(facts), foot])
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(title=text(f"{info.id}: report"), body=body)
