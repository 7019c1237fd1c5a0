"""The page about a session."""

from pathlib import Path

from controller.operation import Operation
from rig.report.page import write_report
from rig.results.recorded import ReportResult
from rig.results.tracking import LoopCount


def report(operation: Operation, session: Path, out: Path | None = None) -> ReportResult:
    """Writes one self-contained page about ``session`` to ``out``, else into the session."""
    target = out or session / "report.html"
    facts = write_report(session, target, operation.step)
    operation.say(f"{target} is written")
    return ReportResult(
        session=str(session),
        file=str(target),
        recordings=len(facts.trials),
        samples=sum(trial.samples for trial in facts.trials),
        dropped=sum(trial.dropped for trial in facts.trials),
        loop=None if isinstance(facts.loop, str) else LoopCount.model_validate(facts.loop),
    )
