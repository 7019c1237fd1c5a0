"""The page about a session."""

from pathlib import Path

from api.operations.opening import opened, results_in
from controller.operation import Operation
from rig.report.page import write_report
from rig.results.recorded import ReportResult
from rig.results.tracking import LoopCount
from rig.trials.opening import AS_IT_IS, Opening, is_session


def report(operation: Operation, place: Path, out: Path | None = None, opening: Opening = AS_IT_IS) -> ReportResult:
    """Writes one self-contained page about what ``place`` holds to ``out``, else into the session.

    What fit, diagnosis and tracking found is taken from the session's folder, else from beside the page.
    """
    target = results_in(place, "report.html", out)
    with opened(place, operation.step, opening) as session:
        facts = write_report(session, target, operation.step, place if is_session(place) else target.parent)
    operation.say(f"{target} is written")
    return ReportResult(
        session=str(place),
        file=str(target),
        recordings=len(facts.trials),
        samples=sum(trial.samples for trial in facts.trials),
        dropped=sum(trial.dropped for trial in facts.trials),
        loop=None if isinstance(facts.loop, str) else LoopCount.model_validate(facts.loop),
    )
