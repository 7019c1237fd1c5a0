"""A diagnosis, and a protocol check, in lines, tables and sentences: once, for terminal and HTML alike."""

from collections.abc import Iterator, Mapping
from itertools import chain, repeat

from rig.diagnosis.estimates import Estimate, NamedCause, SimulationError, SmallestSize
from rig.results.diagnosis import DiagnosisResult, ProtocolCheckResult
from rig.results.diagnosis_lines import five_lines, unit_after
from rig.results.tables import Part, TextTable


def diagnosis_parts(result: DiagnosisResult) -> Iterator[Part]:
    """All of a diagnosis: five lines, the verdict in a sentence, then tables."""
    yield from five_lines(result)
    if result.verdict != "not judged":  # the lines say why
        yield f"verdict: {result.verdict}. {result.statement}"
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
        (cause, name, *_cells(found))
        for finding in result.findings
        for cause, (name, found) in zip(_once(" or ".join(finding.effects)), finding.parameters.items(), strict=False)
    ]
    title = "Named provisionally" if any(finding.provisional for finding in result.findings) else "Named"
    return TextTable(title, ("cause", "parameter", "value", "95 % interval"), rows, words=2)


def _cells(found: Estimate) -> tuple[str, str]:
    bound = ", at its bound" * found.at_bound
    return f"{found.value:.4g}{unit_after(found)}", f"{found.low:.4g} to {found.high:.4g}{bound}"


def _once(text: str) -> Iterator[str]:
    """``text``, then nothing for ever: a name beside the first of its rows."""
    return chain([text], repeat(""))


def gain_sentence(finding: NamedCause) -> str:
    """What a named cause takes off the error, how surely, and what repairs it."""
    gain, error = finding.gain, finding.evidence_se_nats
    before, after = gain.errors
    surely = f", evidence of {finding.evidence_nats / error:.2g} standard errors" if error else ""
    return (
        f"{finding.effects[0]}: error on recordings left out {before:.4f} -> {after:.4f} {gain.unit} "
        f"({100 * gain.reduction:.0f} % less, {100 * gain.low:.0f} to {100 * gain.high:.0f}){surely}; {finding.repair}"
    )


def detectable_table(found: Mapping[str, SmallestSize], title: str, header: str) -> TextTable:
    """From what size each cause would be named, and how often it was where it was tried."""
    rows = [
        (name, f"{size.minimum:.3g} {size.unit}".removesuffix(" 1"), _tried(size))
        for name, size in sorted(found.items())
    ]
    return TextTable(title, ("cause", header, "planted, and found"), rows, words=3)


def _tried(size: SmallestSize) -> str:
    return f"{size.found} of {size.trials}" if size.trials else "an estimate"


def further_parts(result: DiagnosisResult) -> Iterator[Part]:
    """What was not found, what could not be tested, and what the data show of themselves."""
    if result.detectable:
        yield detectable_table(result.detectable, "Not found", "would have been named from")
    if result.parameters:
        yield from untestable_sentences(result.not_testable)
    else:
        yield f"cannot be tested: any of the {len(result.not_testable)} causes, for this reason"
    yield from map(_in_closed_loop, result.simulation_error)
    yield from (finding.sentence for finding in result.data_quality)


def untestable_sentences(reasons: Mapping[str, str]) -> list[str]:
    """Each reason once, with the causes it holds for."""
    return [
        f"cannot be tested: {', '.join(sorted(name for name, why in reasons.items() if why == reason))}: {reason}"
        for reason in dict.fromkeys(reasons.values())
    ]


def _in_closed_loop(item: SimulationError) -> str:
    which = "fitted" if item.fitted else "left out"
    others = "".join(f"; {name} {percent:.2f} %" for name, percent in item.reference_percent.items())
    return (
        f"closed-loop effort error, {item.recording} ({which}): "
        f"{item.before_percent:.2f} % -> {item.after_percent:.2f} %{others}"
    )


def check_parts(result: ProtocolCheckResult) -> Iterator[Part]:
    """What the protocol can show, and the pairs it cannot separate safely."""
    yield f"{result.cycles} cycles in {result.duration_s:.0f} s"
    yield detectable_table(result.detectable, f"On {result.tissue}, with noise as of the mock bench", "visible from")
    pairs = [(*one.pair, f"{one.nats:.1f}") for one in (*result.not_separable, *result.ambiguous)]
    if pairs:
        header = ("cause", "imitated by", f"nats left of {result.confusion_nats.of:g}")
        yield TextTable("Hard to separate (safe from 20)", header, pairs, words=2)
    yield from untestable_sentences(result.not_testable)
