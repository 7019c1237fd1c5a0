"""The diagnosis of a session as a part of its report: the sentence, the numbers, the pictures `rig diagnose` left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rig.report.ink import inlined, saved_figures
from rig.report.markup import figure, paragraph, parts, section
from rig.results.diagnosis import FILE, FOLDER, PICTURES, TRUTH, DiagnosisResult
from rig.results.diagnosis_lines import five_lines
from rig.results.diagnosis_tables import further_parts, named_parts

TITLE = "What the simulation gets wrong"
CAPTIONS = {
    "share": "The power of the error of the simulation as it is: noise, what else differs between repeats of one "
    "motion, what the causes named explain, and what is left.",
    "simulation": "Above, the recording after the first that tells most, and the band that holds 95 % of the errors; "
    "below, the error before (grey) and after (orange) the causes named were put in, and the band of noise.",
    "residuals": "The error against each variable it may depend on, before (grey) and after (orange), with bands that "
    "hold 95 %, over recordings; marked is what the cause named was seen by, or what the error still depends on.",
    "evidence": "Evidence on recordings left out for the causes tried at each step; the one taken is orange.",
    "confusability": "How much of the evidence for a cause (row) is left in this experiment once another (column) "
    "imitates it: pale pairs cannot be told apart.",
}


@dataclass(frozen=True)
class Diagnosed:
    """What `rig diagnose` left in a session: its result, its pictures as SVG by name, and what a demonstration hid."""

    result: DiagnosisResult
    pictures: Mapping[str, str]
    truth: str


def read_diagnosis(results: Path, place: Path | None = None) -> Diagnosed | str:
    """The diagnosis in the folder of a session's results, or why there is none; ``place`` is what was diagnosed."""
    folder, command = results / FOLDER, f"rig diagnose {place or results}"
    result = DiagnosisResult.read_or_why(folder / FILE, "This session was not diagnosed", command)
    if isinstance(result, str):
        return result
    truth = folder / TRUTH
    return Diagnosed(result, saved_figures(folder, PICTURES), truth.read_text().strip() if truth.exists() else "")


def diagnosis_section(found: Diagnosed | str) -> str:
    """The part of the page."""
    if isinstance(found, str):
        return section(TITLE, paragraph(found, "missing"))
    result = found.result
    pictures = {
        name: figure(inlined(found.pictures[name], f"diagnosis-{name}", CAPTIONS[name]), CAPTIONS[name])
        for name in telling_first(result)
        if name in found.pictures
    }
    truth = paragraph(f"The truth, which the analysis was not told. {found.truth}", "note") if found.truth else ""
    lines = parts(five_lines(result)), pictures.pop("share", "")
    said = paragraph(result.statement), parts(named_parts(result)), *pictures.values(), parts(further_parts(result))
    return section(TITLE, *lines, *said, truth)


def telling_first(result: DiagnosisResult) -> Sequence[str]:
    """Names of pictures; where no cause is named the shape of what is left comes before the recording."""
    return PICTURES if result.findings else sorted(PICTURES, key=("share", "residuals", *PICTURES).index)
