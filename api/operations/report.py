"""The page about a session."""

from pathlib import Path

from controller.operation import Operation
from rig.report.page import write_report
from rig.results.recorded import ReportResult


def report(operation: Operation, session: Path, out: Path | None = None) -> ReportResult:
    """Writes one self-contained page about ``session`` to ``out``, else into the session; returns where that is."""
    target = out or session / "report.html"
    write_report(session, target, operation.step)
    operation.say(f"{target} is written")
    return ReportResult(session=str(session), file=str(target))
