"""The diagnosis of a session as a part of its report: the sentence, the numbers, the pictures `rig diagnose` left."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rig.diagnosis.files import FOLDER, PICTURES, RESULT, TRUTH
from rig.report.drawing import inlined
from rig.report.markup import figure, paragraph, section, table
from rig.report.values import json_table, listed, number

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
    """What `rig diagnose` left in a session: its JSON, its pictures as SVG by name, and what a demonstration hid."""

    result: Mapping[str, object]
    pictures: Mapping[str, str]
    truth: str

    @property
    def statement(self) -> str:
        """The whole in one sentence."""
        return str(self.result.get("statement", ""))


def read_diagnosis(session: Path) -> Diagnosed | str:
    """The diagnosis in the session's folder, or the sentence that says why there is none."""
    folder = session / FOLDER
    try:
        result = json_table((folder / RESULT).read_text())
    except OSError:
        return f"This session was not diagnosed; `rig diagnose {session}` does it."
    if "verdict" not in result:
        return f"{folder / RESULT} holds no diagnosis; run `rig diagnose {session}` again."
    drawn = {name: folder / f"{name}.svg" for name in PICTURES}
    truth = folder / TRUTH
    pictures = {name: path.read_text() for name, path in drawn.items() if path.exists()}
    return Diagnosed(result, pictures, truth.read_text().strip() if truth.exists() else "")


def diagnosis_section(found: Diagnosed | str) -> str:
    """The part of the page."""
    if isinstance(found, str):
        return section(TITLE, paragraph(found, "missing"))
    result = found.result
    pieces = [paragraph(found.statement)]
    rows = [_row(item) for item in listed(result.get("findings"))]
    if rows:
        header = ("cause", "parameters, 95 % interval", "repair", "error before", "after", "reduction, %")
        pieces.append(table(header, rows, "Named; errors are those on recordings left out", words=3))
    pieces += [
        figure(inlined(text, f"diagnosis-{name}", CAPTIONS[name]), CAPTIONS[name])
        for name, text in found.pictures.items()
    ]
    pieces.append(_visible(result))
    untested = result.get("not_testable")
    if isinstance(untested, Mapping) and untested:
        pieces.append(table(("cannot be tested", "why"), [(str(k), str(v)) for k, v in untested.items()], words=2))
    after = result.get("next_experiment")
    if isinstance(after, Mapping):
        pieces.append(paragraph(f"Next experiment: {after.get('do', '')}."))
    if found.truth:
        pieces.append(paragraph(f"The truth, which the analysis was not told. {found.truth}", "note"))
    return section(TITLE, *pieces)


def _row(item: Mapping[str, object]) -> tuple[str, ...]:
    effects, parameters, gain = item.get("effects"), item.get("parameters"), item.get("gain")
    named = " or ".join(map(str, effects)) if isinstance(effects, list) else ""
    sizes = parameters.items() if isinstance(parameters, Mapping) else ()
    values = ", ".join(f"{name} {_interval(value)}" for name, value in sizes)
    found = gain if isinstance(gain, Mapping) else {}
    before, after = (
        next((value for key, value in found.items() if key.startswith(start)), None)
        for start in ("rmse_before", "rmse_after")
    )
    reduction = number(found, "reduction")
    return (
        named, values, str(item.get("repair", "")), _shown(before, ".4f"), _shown(after, ".4f"),
        "\u2013" if reduction is None else f"{100 * reduction:.0f}",
    )  # fmt: skip


def _interval(value: object) -> str:
    if not isinstance(value, Mapping):
        return ""
    return (
        f"{_shown(value.get('value'), '.4g')} ({_shown(value.get('low'), '.4g')} to {_shown(value.get('high'), '.4g')})"
    )


def _shown(value: object, form: str) -> str:
    return format(value, form) if isinstance(value, int | float) else "\u2013"


def _visible(result: Mapping[str, object]) -> str:
    seen = result.get("detectable")
    if not isinstance(seen, Mapping) or not seen:
        return ""
    rows = [
        (str(name), f"{_shown(item.get('minimum'), '.3g')} {item.get('unit', '')}")
        for name, item in seen.items()
        if isinstance(item, Mapping)
    ]
    return table(("not found", "would have been named from"), rows, words=2)
