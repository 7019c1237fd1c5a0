"""The parts of the report, each a pure function from facts to markup."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from rig.channels import EVENT
from rig.recording.verify import StreamVerdict, Verdict
from rig.report.diagnosed import Diagnosed, diagnosis_section
from rig.report.drawing import inline_svg
from rig.report.facts import Facts, LoopFacts, TrackingFacts, TrialFacts
from rig.report.figures import fit_figure, loop_figure, quantiles, residual_figure, tracking_figure
from rig.report.markup import cards, details, figure, pairs, paragraph, section, table
from rig.report.values import json_table, number, of_many
from rig.tissue.judging import LEVEL, Errors, Judged
from rig.tissue.study import Row, Study, rows

STREAM_FAULTS = ("missing", "dropped", "lost", "duplicate", "out of order")
LEVEL_COLUMNS = {
    "given_N": ("given, N", ".2f"),
    "actual_N": ("actual, N", ".3f"),
    "error_N": ("error, N", "+.3f"),
    "error_percent": ("error, %", "+.2f"),
    "max_error_N": ("largest error, N", ".3f"),
    "rms_error_N": ("rms error, N", ".4f"),
    "overshoot_percent": ("overshoot, %", ".1f"),
    "settling_s": ("settling, s", ".2f"),
}


def headline(facts: Facts) -> str:
    """What came out, in one sentence."""
    study, tracking = facts.study, facts.tracking
    if isinstance(study, str):
        return f"{len(facts.trials)} {of_many('recording', len(facts.trials))}, without a fit"
    index, constant = _fair(study.judged["index"]), _fair(study.judged["constant"])
    where = "left\u2011out trials" if study.judged["index"].trials_left_out else "the trials fitted"
    said = (
        f"The index model predicts displacement on {where} within {index.max_error_mm:.2g}\u00a0mm "
        f"({index.max_error_percent:.2g}\u00a0%), constant stiffness within {constant.max_error_mm:.2g}\u00a0mm "
        f"({constant.max_error_percent:.2g}\u00a0%)"
    )
    worst = number(tracking.result, "max_error_percent") if isinstance(tracking, TrackingFacts) else None
    return said if worst is None else f"{said}; force was tracked within {worst:.2g}\u00a0%"


def _fair(judged: Judged) -> Errors:
    return judged.trials_left_out or judged.fitted


def key_figures(facts: Facts) -> str:
    """The figures a reader looks for first."""
    good = sum(1 for trial in facts.trials if not isinstance(trial.verdict, str) and trial.verdict.ok)
    found = [
        (f"{len(facts.trials)}", of_many("recording", len(facts.trials)), f"{good} complete and without loss"),
        (f"{sum(trial.samples for trial in facts.trials):,}", "samples", ""),
        (f"{sum(trial.dropped for trial in facts.trials):,}", "dropped samples", ""),
    ]
    if isinstance(facts.study, Study):
        for name, judged in facts.study.judged.items():
            out = judged.trials_left_out
            note = f"{out.max_error_percent:.3g} % on left-out trials" if out else "no trial could be left out"
            found.append((f"{judged.fitted.max_error_percent:.3g} %", f"worst error, {name} model", note))
    if isinstance(facts.tracking, TrackingFacts):
        worst, rms = (number(facts.tracking.result, key) for key in ("max_error_percent", "rms_error_N"))
        if worst is not None and rms is not None:
            found.append((f"{worst:.3g} %", "worst force-tracking error", f"{rms:.2g} N rms"))
    if isinstance(facts.loop, LoopFacts):
        share = 100 * facts.loop.missed / max(facts.loop.ticks + facts.loop.missed, 1)
        found.append((f"{facts.loop.missed:,}", "missed loop slots", f"{share:.2g} % of {facts.loop.ticks:,}"))
    return cards(found)


def simulated(facts: Facts) -> str:
    """A sentence where the devices were served on pseudo-terminals, which no hardware is; else nothing."""
    tables = (json_table(text) for text in facts.metadata.get("wiring", {}).values())
    if not any(str(table.get("port", "")).startswith("/dev/pts/") for table in tables):
        return ""
    return paragraph(
        "Simulated bench: the devices were served on pseudo-terminals, so these figures say how well the software "
        "recovers a tissue of known law, and nothing about people.",
        "note",
    )


def diagnosed(facts: Facts) -> str:
    """The diagnosis in one sentence; nothing where there is none."""
    return paragraph(facts.diagnosis.statement, "lead") if isinstance(facts.diagnosis, Diagnosed) else ""


def sections(facts: Facts) -> Iterator[str]:
    """All parts below the key figures, in order."""
    yield _curves(facts.study)
    yield _errors(facts.study)
    yield _tracking(facts.tracking)
    yield diagnosis_section(facts.diagnosis)
    yield _loop(facts)
    yield _recorded(facts)
    yield _setup(facts)


def _curves(study: Study | str) -> str:
    title = "Force and displacement"
    if isinstance(study, str):
        return section(title, paragraph(study, "missing"))
    speeds = [
        (f"{s.speed_mm_s:g}", f"{s.trials}", f"{s.max_depth_mm:.2f}", f"{s.max_force_N:.2f}") for s in study.speeds
    ]
    curves = inline_svg(fit_figure(study), "fit", "Force against displacement with both models, and their errors")
    residuals = inline_svg(residual_figure(study), "residuals", "Residual force of both models over displacement")
    return section(
        title,
        figure(
            curves,
            "Left: every trial's loading curve, coloured by speed, and the two fitted models (the band is their range "
            "over the speeds). Right: at each given force, the worst trial's error of predicted displacement.",
        ),
        figure(residuals, "What each model leaves over: modelled minus measured force, one line a trial."),
        table(("speed, mm/s", "trials", "largest depth, mm", "largest force, N"), speeds, words=0),
        *[paragraph(f"Not used: {reason}", "warning") for _, reason in study.skipped],
    )


def _errors(study: Study | str) -> str:
    title = "Constant stiffness and index model"
    if isinstance(study, str):
        return section(title, paragraph(study, "missing"))
    return section(
        title,
        paragraph(
            "Errors are |predicted − measured| displacement at given forces, in mm and in percent of measured; the "
            "largest over trials is shown. For a left-out trial the model was fitted without it, and only the first "
            "quarter of its force was used, to find where it touches. For comparison: the study reports 57.5 % for "
            "constant stiffness and 4.6 % for the index model, both on the curve they were fitted to."
        ),
        _summary_table(study),
        _row_table(study),
        _parameter_table(study),
    )


def _summary_table(study: Study) -> str:
    found = []
    for name, judged in study.judged.items():
        found.append((name, "trials fitted", *_worst(judged.fitted)))
        found.append((name, "each trial left out", *_worst(judged.trials_left_out)))
        found.append((name, "each speed left out", *_worst(judged.speeds_left_out)))
        found.append((name, "each subject left out", *_worst(judged.subjects_left_out)))
    return table(
        ("model", "judged on", "worst, mm", "worst, %", "force residual, N rms"), found, "Worst errors", words=2
    )


def _worst(errors: Errors | None) -> tuple[str, str, str]:
    if errors is None:
        return "–", "–", "–"
    return f"{errors.max_error_mm:.3f}", f"{errors.max_error_percent:.1f}", f"{errors.rmse_N:.3f}"


def _row_table(study: Study) -> str:
    by_law = {name: rows(judged.fitted) for name, judged in study.judged.items()}
    header = ["given force, N", "measured, mm"]
    for name in by_law:
        header += [f"{name}, mm", "error, mm", "error, %"]
    first = next(iter(by_law.values()))
    found = []
    for index, row in enumerate(first):
        cells = [f"{row.force_N:.2f}", f"{row.measured_mm:.2f} ± {row.measured_spread_mm:.2f}"]
        for found_rows in by_law.values():
            cells += _row_cells(found_rows[index])
        found.append(cells)
    caption = "Displacement at given forces: mean ± standard deviation over trials, model, and the worst trial's error"
    return table(header, found, caption, words=0)


def _row_cells(row: Row) -> list[str]:
    return [f"{row.predicted_mm:.2f}", f"{row.error_mm:.3f}", _known(row.error_percent, ".1f")]


def _known(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "–"


def _parameter_table(study: Study) -> str:
    found = []
    for name, judged in study.judged.items():
        for parameter in judged.law.parameters:
            lower, upper = judged.intervals[parameter.name]
            bound = parameter.name in judged.fit.at_bounds
            interval = "at its bound" if bound else f"{lower:.4g} to {upper:.4g}"
            found.append((name, parameter.name.split("_")[0], f"{parameter.value:.4g}", interval, parameter.unit))
    formulas = "; ".join(f"{name}: {judged.law.formula}" for name, judged in study.judged.items())
    method = next(iter(study.judged.values())).interval_method
    caption = f"Parameters with {100 * LEVEL:.0f} % intervals ({method}). {formulas}"
    return table(("model", "parameter", "value", "interval", "unit"), found, caption, words=2)


def _tracking(tracking: TrackingFacts | str) -> str:
    title = "Force tracking"
    if isinstance(tracking, str):
        return section(title, paragraph(tracking, "missing"))
    picture = inline_svg(tracking_figure(tracking.run), "tracking", "Given and actual force over time, and the error")
    pieces = [figure(picture, "Given and actual force as the loop saw them, unfiltered, and their difference.")]
    levels = tracking.result.get("levels")
    if isinstance(levels, list) and levels:
        found = [_level_row(level) for level in levels if isinstance(level, dict)]
        header = [name for name, _ in LEVEL_COLUMNS.values()]
        pieces.append(table(header, found, "Given and actual force on each level", words=0))
    else:
        pieces.append(
            paragraph("No table of given and actual force: track.json is missing or not readable.", "missing")
        )
    return section(title, *pieces)


def _level_row(level: Mapping[str, object]) -> list[str]:
    numbers = ((number(level, key), form) for key, (_, form) in LEVEL_COLUMNS.items())
    return ["–" if value is None else format(value, form) for value, form in numbers]


def _loop(facts: Facts) -> str:
    title = "The loop"
    if isinstance(facts.loop, str):
        return section(title, paragraph(facts.loop, "missing"))
    loop = facts.loop
    picture = inline_svg(
        loop_figure(loop.wake_us, loop.execution_us, loop.period_us),
        "loop",
        "How late the loop woke and how long it worked",
    )
    timing = {"wake-up after due": loop.wake_us, "work in a tick": loop.execution_us} | {
        f"age of {name} when used": ages for name, ages in loop.ages_us.items()
    }
    found = [(name, *(f"{value:,.0f}" for value in quantiles(values).values())) for name, values in timing.items()]
    granted = dict(facts.realtime)
    granted.pop("crc32", None)
    rate_Hz = 1e6 / loop.period_us
    return section(
        title,
        figure(picture, f"All {loop.ticks:,} ticks of all recordings at {rate_Hz:,.0f} Hz; all axes are logarithmic."),
        table(("time, µs", "median", "99 %", "largest"), found),
        paragraph(f"{loop.missed:,} slots were missed while recording; a missed slot is skipped and counted."),
        pairs({f"real time: {name.replace('_', ' ')}": value for name, value in granted.items()}) if granted
        else paragraph("Which real-time privileges were granted is not in the recordings.", "missing"),
    )  # fmt: skip


def _recorded(facts: Facts) -> str:
    found = [_trial_row(trial) for trial in facts.trials]
    faults = [
        paragraph(trial.verdict if isinstance(trial.verdict, str) else trial.verdict.sentence, "warning")
        for trial in facts.trials
        if isinstance(trial.verdict, str) or not trial.verdict.ok
    ]
    faults += [
        paragraph(f"{trial.info.name}: quality {trial.info.quality}: {'; '.join(trial.info.reasons)}", "warning")
        for trial in facts.trials
        if trial.info.reasons
    ]
    header = ("recording", "outcome", "verdict", "quality", "speed, mm/s", "peak force, N", "samples", "dropped")
    return section(
        "What was recorded",
        *[paragraph(remark, "warning") for remark in facts.session.remarks],
        *faults,
        table(header, found, words=4) if found else paragraph("No recording.", "missing"),
        _stream_table(facts.trials),
    )


def _stream_table(trials: Sequence[TrialFacts]) -> str:
    by_stream: dict[str, list[StreamVerdict]] = {}
    for trial in trials:
        for name, stream in {} if isinstance(trial.verdict, str) else trial.verdict.streams.items():
            by_stream.setdefault(name, []).extend([stream] if stream.samples else [])
    found = [
        (
            name,
            f"{sum(one.samples for one in streams):,}",
            _known(float(np.median([one.rate_Hz for one in streams])), ".1f"),
            *(f"{sum(one.faults.get(fault, 0) for one in streams):,}" for fault in STREAM_FAULTS),
        )
        for name, streams in by_stream.items()
        if streams and name != EVENT.name
    ]
    header = ("stream", "samples", "rate, Hz", *STREAM_FAULTS)
    return table(header, found, "All recordings together; the rate is the median over recordings") if found else ""


def _trial_row(trial: TrialFacts) -> Sequence[str]:
    info = trial.info
    speed, peak = _known(info.speed_mm_s, "g"), _known(info.peak_force_N, ".2f")
    counts = f"{trial.samples:,}", f"{trial.dropped:,}"
    return info.name, info.outcome, _state(trial.verdict), info.quality or "not judged", speed, peak, *counts


def _state(verdict: Verdict | str) -> str:
    if isinstance(verdict, str):
        return "cannot be read"
    return "with losses" if verdict.state == "complete" and not verdict.ok else verdict.state


def _setup(facts: Facts) -> str:
    info = facts.session.info
    devices = [
        (role, *(str(identity.get(key, "–")) for key in ("product", "serial", "firmware")))
        for role, identity in facts.devices.items()
    ]
    protocol = {key: _plain(value) for key, value in info.protocol.items()}
    about = {"subject": info.subject, "notes": info.notes}
    known = {f"{name}: {key}": _plain(value) for name, values in about.items() for key, value in values.items()}
    return section(
        "Bench, subject and protocol",
        table(("device", "product", "serial number", "firmware"), devices, words=4) if devices
        else paragraph("The recordings name no device.", "missing"),
        pairs({"session": info.id, "recorded": info.created, "software": info.software, **known}),
        details("Protocol", pairs(protocol)) if protocol else paragraph("No protocol: imported data.", "missing"),
    )  # fmt: skip


def _plain(value: object) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(_plain(item) for item in value)
    return json.dumps(value) if isinstance(value, dict) else str(value)
