"""The parts of the report, each a pure function from facts to markup."""

import json
from collections.abc import Iterator, Sequence

import numpy as np

from rig.channels import EVENT
from rig.recording.verify import StreamVerdict, Verdict
from rig.report.came_in import came_in_section
from rig.report.diagnosed import Diagnosed, diagnosis_section
from rig.report.drawing import inline_svg
from rig.report.facts import Facts, LoopFacts, TrackingFacts, TrialFacts
from rig.report.figures import loop_figure, quantiles, tracking_figure
from rig.report.fitted import Fitted, fit_sections
from rig.report.markup import cards, details, figure, pairs, paragraph, parts, section, table
from rig.report.values import json_table, of_many
from rig.results.base import known
from rig.results.diagnosis_lines import five_lines
from rig.results.fit import LawResult
from rig.results.tables import TextTable, render, track_parts
from rig.results.tracking import TrackResult

STREAM_FAULTS = ("missing", "dropped", "lost", "duplicate", "out of order")


def headline(facts: Facts) -> str:
    """What came out, in one sentence."""
    fit, tracking = facts.fit, _tracked(facts)
    if isinstance(fit, str):
        return f"{len(facts.trials)} {of_many('recording', len(facts.trials))}, without a fit"
    laws = fit.result.laws
    where = "left\u2011out trials" if laws["index"].held_out.trials else "the trials fitted"
    said = (
        f"The index law predicts displacement on {where} within {_within(laws['index'])}, "
        f"constant stiffness within {_within(laws['constant'])}"
    )
    worst = tracking.max_error_percent if tracking else None
    return said if worst is None else f"{said}; force was tracked within {worst:.2g}\u00a0%"


def _within(law: LawResult) -> str:
    errors = law.held_out.trials or law
    return f"{render(errors.max_error_mm, '.2g')}\u00a0mm ({render(errors.max_error_percent, '.2g')}\u00a0%)"


def _tracked(facts: Facts) -> TrackResult | None:
    result = facts.tracking.result if isinstance(facts.tracking, TrackingFacts) else None
    return result if isinstance(result, TrackResult) else None


def key_figures(facts: Facts) -> str:
    """The figures a reader looks for first."""
    good = sum(1 for trial in facts.trials if not isinstance(trial.verdict, str) and trial.verdict.ok)
    found = [
        (f"{len(facts.trials)}", of_many("recording", len(facts.trials)), f"{good} complete and without loss"),
        (f"{sum(trial.samples for trial in facts.trials):,}", "samples", ""),
        (f"{sum(trial.dropped for trial in facts.trials):,}", "dropped samples", ""),
    ]
    if isinstance(facts.fit, Fitted):
        for name, law in facts.fit.result.laws.items():
            out = law.held_out.trials
            note = f"{render(out.max_error_percent, '.3g')} % on left-out trials" if out else "no trial was left out"
            found.append((f"{render(law.max_error_percent, '.3g')} %", f"worst error, {name} law", note))
    tracking = _tracked(facts)
    if tracking and tracking.max_error_percent is not None:
        note = f"{render(tracking.rms_error_N, '.2g')} N rms"
        found.append((f"{tracking.max_error_percent:.3g} %", "worst force-tracking error", note))
    if isinstance(facts.loop, LoopFacts):
        share = 100 * facts.loop.missed / max(facts.loop.cycles + facts.loop.missed, 1)
        found.append((f"{facts.loop.missed:,}", "missed loop cycles", f"{share:.2g} % of {facts.loop.cycles:,}"))
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
    """What is explained, by which cause; nothing where there is no diagnosis."""
    if not isinstance(facts.diagnosis, Diagnosed):
        return ""
    _, explained, cause, *_ = five_lines(facts.diagnosis.result)
    return paragraph(explained, "lead") + paragraph(cause, "lead")


def sections(facts: Facts) -> Iterator[str]:
    """All parts below the key figures, in order."""
    yield from fit_sections(facts.fit)
    yield _tracking(facts.tracking)
    yield diagnosis_section(facts.diagnosis)
    yield came_in_section(facts.came_in)
    yield _loop(facts)
    yield _recorded(facts)
    yield _setup(facts)


def _tracking(tracking: TrackingFacts | str) -> str:
    title = "Force tracking"
    if isinstance(tracking, str):
        return section(title, paragraph(tracking, "missing"))
    picture = inline_svg(
        tracking_figure(tracking.run), "tracking", "Reference and actual force over time, and the error"
    )
    pieces = [figure(picture, "Reference and actual force as the loop saw them, unfiltered, and their difference.")]
    if isinstance(tracking.result, str):
        return section(title, *pieces, paragraph(tracking.result, "missing"))
    return section(title, *pieces, parts(track_parts(tracking.result)))


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
    timing = {"wake-up after due": loop.wake_us, "work in a cycle": loop.execution_us} | {
        f"age of {name} when used": ages for name, ages in loop.ages_us.items()
    }
    found = [(name, *(f"{value:,.0f}" for value in quantiles(values).values())) for name, values in timing.items()]
    granted = dict(facts.realtime)
    granted.pop("crc32", None)
    rate_Hz = 1e6 / loop.period_us
    return section(
        title,
        figure(picture, f"All {loop.cycles:,} cycles of the recordings at {rate_Hz:,.0f} Hz; axes are logarithmic."),
        table(TextTable("", ("time (µs)", "median", "99 %", "largest"), found)),
        paragraph(f"{loop.missed:,} cycles were missed while recording; a missed cycle is skipped and counted."),
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
    header = ("recording", "outcome", "verdict", "quality", "speed (mm/s)", "peak force (N)", "samples", "dropped")
    return section(
        "What was recorded",
        *[paragraph(remark, "warning") for remark in facts.session.remarks],
        *faults,
        table(TextTable("", header, found, words=4)) if found else paragraph("No recording.", "missing"),
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
            render(_median([one.rate_Hz for one in streams if one.rate_Hz is not None]), ".1f"),
            *(f"{sum(one.faults.get(fault, 0) for one in streams):,}" for fault in STREAM_FAULTS),
        )
        for name, streams in by_stream.items()
        if streams and name != EVENT.name
    ]
    header = ("stream", "samples", "rate (Hz)", *STREAM_FAULTS)
    title = "All recordings together; the rate is the median over recordings"
    return table(TextTable(title, header, found)) if found else ""


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None


def _trial_row(trial: TrialFacts) -> Sequence[str]:
    info = trial.info
    speed, peak = render(known(info.speed_mm_s), "g"), render(known(info.peak_force_N), ".2f")
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
        table(TextTable("", ("device", "product", "serial number", "firmware"), devices, words=4)) if devices
        else paragraph("The recordings name no device.", "missing"),
        pairs({"session": info.id, "recorded": info.created, "software": info.software, **known}),
        details("Protocol", pairs(protocol)) if protocol else paragraph("No protocol: imported data.", "missing"),
    )  # fmt: skip


def _plain(value: object) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(_plain(item) for item in value)
    return json.dumps(value) if isinstance(value, dict) else str(value)
