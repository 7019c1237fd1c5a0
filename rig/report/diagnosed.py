"""The diagnosis of a session as a part of its report: the sentence, the numbers, the pictures `rig diagnose` left."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rig.report.drawing import inlined, saved_figures
from rig.report.markup import figure, paragraph, parts, section
from rig.results.diagnosis import FILE, FOLDER, PICTURES, TRUTH, DiagnosisResult
from rig.results.diagnosis_tables import further_parts, named_parts

TITLE = "What the simulation gets wrong"
CAPTIONS = {
    "simulation": "Above, the recording the simulation gets most wrong; below, the error before (grey) and after "
    "(orange) the causes named were put into it.",
    "residuals": "The error against each variable it may depend on, before (grey) and after (orange); marked is "
    "what the cause named was seen by, or what the error still depends on.",
    "evidence": "Evidence on recordings left out for each cause tried first; the causes named are orange.",
    "confusability": "How much of the evidence for a cause (row) is left in this experiment once another (column) "
    "imitates it: pale pairs cannot be told apart.",
}


@dataclass(frozen=True)
class Diagnosed:
    """What `rig diagnose` left in a session: its result, its pictures as SVG by name, and what a demonstration hid."""

    result: DiagnosisResult
    pictures: Mapping[str, str]
    truth: str


def read_diagnosis(session: Path) -> Diagnosed | str:
    """The diagnosis in the session's folder, or the sentence that says why there is none."""
    folder = session / FOLDER
    result = DiagnosisResult.read_or_why(folder / FILE, "This session was not diagnosed", f"rig diagnose {session}")
    if isinstance(result, str):
        return result
    truth = folder / TRUTH
    return Diagnosed(result, saved_figures(folder, PICTURES), truth.read_text().strip() if truth.exists() else "")


def diagnosis_section(found: Diagnosed | str) -> str:
    """The part of the page."""
    if isinstance(found, str):
        return section(TITLE, paragraph(found, "missing"))
    result = found.result
    pictures = [
        figure(inlined(text, f"diagnosis-{name}", CAPTIONS[name]), CAPTIONS[name])
        for name, text in found.pictures.items()
    ]
    truth = paragraph(f"The truth, which the analysis was not told. {found.truth}", "note") if found.truth else ""
    said = paragraph(result.statement), parts(named_parts(result)), *pictures, parts(further_parts(result))
    return section(TITLE, *said, truth)
