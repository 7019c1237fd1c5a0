"""The fit of a session as parts of its report: what `rig fit` saved, with the laws and known values asked for."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from rig.recording.sessions import Session
from rig.report.ink import inlined, saved_figures
from rig.report.markup import figure, paragraph, parts, section
from rig.results.fit import FILE, FOLDER, PICTURES, FitResult
from rig.results.tables import curve_parts, lattice_parts, law_parts

CURVES, LAWS, LATTICE = "Force and displacement", "Tissue laws compared", "Mass-spring lattice"
CAPTIONS = {
    "fit": "Left: every trial's loading curve, coloured by speed, and the fitted laws (the band is their range over "
    "the speeds). Right: at each given force, the worst trial's error of predicted displacement.",
    "residuals": "What each law leaves over: modelled minus measured force, one line a trial.",
    "lattice": "Left: displacement simulated and measured. Right: spring stiffness at each force, and the index law "
    "through it.",
}


@dataclass(frozen=True)
class Fitted:
    """What `rig fit` left in a session: its result, its pictures as SVG by name, and what has changed since."""

    result: FitResult
    pictures: Mapping[str, str]
    changes: tuple[str, ...]


def read_fit(session: Session, results: Path) -> Fitted | str:
    """The fit of the session in the folder of its results, or the sentence that says why there is none."""
    folder = results / FOLDER
    result = FitResult.read_or_why(folder / FILE, "This session was not fitted", f"rig fit {session.place}")
    if isinstance(result, str):
        return result
    return Fitted(result, saved_figures(folder, PICTURES), tuple(_changes(session, result)))


def _changes(session: Session, result: FitResult) -> Iterator[str]:
    """What the fit does not know of the session's indentations; runs of force tracking come after it and are none."""
    now = {trial.name: trial.sha256 for trial in session.trials}
    for name in sorted(result.recordings.keys() | now.keys()):
        if name not in result.recordings and session.trial(name).speed_mm_s > 0:
            yield f"{name} was recorded after the fit and is not in it"
        elif name not in now:
            yield f"{name}, which the fit was made from, is not in the session"
        elif result.recordings.get(name, now[name]) != now[name]:
            yield f"{name} was changed after the fit"


def fit_sections(found: Fitted | str) -> Iterator[str]:
    """The parts of the page."""
    if isinstance(found, str):
        yield section(CURVES, paragraph(found, "missing"))
        return
    yield _curves(found)
    yield _laws(found.result)
    if found.result.lattice:
        yield section(LATTICE, *_pictures(found.pictures, "lattice"), parts(lattice_parts(found.result.lattice)))


def _pictures(pictures: Mapping[str, str], *names: str) -> list[str]:
    return [figure(inlined(pictures[name], name, CAPTIONS[name]), CAPTIONS[name]) for name in names if name in pictures]


def _curves(found: Fitted) -> str:
    again = "; run `rig fit` again."
    return section(
        CURVES,
        *[paragraph(change + again, "warning") for change in found.changes],
        *_pictures(found.pictures, "fit", "residuals"),
        parts(curve_parts(found.result)),
    )


def _laws(result: FitResult) -> str:
    formulas = "; ".join(f"{name}: {law.formula}" for name, law in result.laws.items())
    given = ", ".join(f"{name} = {value:g}" for name, value in result.known.items())
    return section(
        LAWS,
        paragraph(
            "Errors are |predicted − measured| displacement at given forces, in mm and in percent of measured; the "
            "largest over trials is shown. For a left-out trial the law was fitted without it, and only the first "
            "quarter of its force was used, to find where it touches. For comparison: the study reports 57.5 % for "
            "constant stiffness and 4.6 % for the index law, both on the curve they were fitted to."
        ),
        paragraph(f"{formulas}.{f' Given, not fitted: {given}.' if given else ''}"),
        parts(law_parts(result, beside=len(result.laws))),
    )
