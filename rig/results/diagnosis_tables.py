"""A diagnosis, and a protocol check, in tables and sentences: once, for terminal and HTML alike."""

from collections.abc import Iterator, Mapping
from itertools import chain, repeat

from rig.diagnosis.estimates import NamedCause, NextExperiment, SimulationError, SmallestSize
from rig.results.diagnosis import DiagnosisResult, ProtocolCheckResult
from rig.results.tables import Part, TextTable

# Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", 2019: symmetric model, closed-loop simulation.
PUBLISHED = {"DATA_EMPS": "; published 5.85 %", "DATA_EMPS_PULSES": "; published 8.94 %"}


def diagnosis_parts(result: DiagnosisResult) -> Iterator[Part]:
    """All of a diagnosis."""
    yield f"{result.verdict}: {result.statement}"
    yield from named_parts(result)
    yield from further_parts(result)


def named_parts(result: DiagnosisResult) -> Iterator[Part]:
    """The causes named, and what each takes off the error."""
    if result.findings:
        yield named_table(result)
        yield from map(gain_sentence, result.findings)


def named_table(result: DiagnosisResult) -> TextTable:
    """The causes named, with their sizes."""
    rows = [
        (cause, name, f"{found.value:.4g}", f"{found.low:.4g} to {found.high:.4g}{', at its bound' * found.at_bound}")
        for finding in result.findings
        for cause, (name, found) in zip(_once(" or ".join(finding.effects)), finding.parameters.items(), strict=False)
    ]
    title = "Named" if result.verdict == "explained" else "Named provisionally"
    return TextTable(title, ("cause", "parameter", "value", "95 % interval"), rows, words=2)


def _once(text: str) -> Iterator[str]:
    """``text``, then nothing for ever: a name beside the first of its rows."""
    return chain([text], repeat(""))


def gain_sentence(finding: NamedCause) -> str:
    """What a named cause takes off the error, and what repairs it."""
    gain = finding.gain
    return (
        f"{finding.effects[0]}: error on recordings left out {gain.rmse_before_N:.4f} -> {gain.rmse_after_N:.4f} N "
        f"({100 * gain.reduction:.0f} % less, {100 * gain.low:.0f} to {100 * gain.high:.0f}), "
        f"{finding.evidence_nats:.0f} nats; {finding.repair}"
    )


def detectable_table(found: Mapping[str, SmallestSize], title: str, header: str) -> TextTable:
    """From what size each cause would be named."""
    rows = [(name, f"{size.minimum:.3g} {size.unit}".removesuffix(" 1")) for name, size in sorted(found.items())]
    return TextTable(title, ("cause", header), rows, words=2)


def further_parts(result: DiagnosisResult) -> Iterator[Part]:
    """What was not found, what could not be tested, what the data show of themselves, and what to do next."""
    if result.detectable:
        yield detectable_table(result.detectable, "Not found", "would have been named from")
    if result.parameters:
        yield from untestable_sentences(result.not_testable)
    else:
        yield f"cannot be tested: any of the {len(result.not_testable)} causes, for this reason"
    yield from map(_in_closed_loop, result.simulation_error)
    yield from (finding.sentence for finding in result.data_quality)
    if result.next_experiment:
        yield next_sentence(result.next_experiment)


def untestable_sentences(reasons: Mapping[str, str]) -> list[str]:
    """Each reason once, with the causes it holds for."""
    return [
        f"cannot be tested: {', '.join(sorted(name for name, why in reasons.items() if why == reason))}: {reason}"
        for reason in dict.fromkeys(reasons.values())
    ]


def _in_closed_loop(item: SimulationError) -> str:
    which = "fitted" if item.fitted else "left out"
    return (
        f"closed-loop force error, {item.recording} ({which}): "
        f"{item.before_percent:.2f} % -> {item.after_percent:.2f} %{PUBLISHED.get(item.recording, '')}"
    )


def next_sentence(experiment: NextExperiment) -> str:
    """The next experiment as a sentence."""
    said = f"next experiment: {experiment.do}"
    if experiment.nats_per_minute is None:
        return said
    causes = " from ".join(experiment.separates)
    return f"{said}, which separates {causes} at {experiment.nats_per_minute:.1f} nats a minute"


def check_parts(result: ProtocolCheckResult) -> Iterator[Part]:
    """What the protocol can show, and the pairs it cannot separate safely."""
    yield f"{result.cycles} cycles in {result.duration_s:.0f} s"
    yield detectable_table(result.detectable, "On a limb and noise as the mock bench has them", "visible from")
    pairs = [(*one.pair, f"{one.nats:.1f}") for one in (*result.not_separable, *result.ambiguous)]
    if pairs:
        header = ("cause", "imitated by", f"nats left of {result.confusion_nats.of:g}")
        yield TextTable("Hard to separate (safe from 20)", header, pairs, words=2)
    yield from untestable_sentences(result.not_testable)
