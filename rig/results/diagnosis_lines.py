"""A diagnosis in five lines for who measures and treats: asked, explained, cause, cost, next."""

from collections.abc import Iterator
from math import sqrt

from rig.diagnosis.estimates import SAFE_NATS, Estimate, NamedCause, NextExperiment, OwnSpread
from rig.results.diagnosis import DiagnosisResult

LINES, WIDTH = ("asked", "explained", "cause", "cost", "next"), len("explained: ")
LONGEST_MIN = 60.0  # nobody holds still for longer
THICKEST_MM = 200.0  # no limb is thicker: the stiffness says nothing there
CALLED = {"touch": "contact"}  # of what recordings have of their own


def five_lines(result: DiagnosisResult) -> list[str]:
    """What was asked, how much is explained, by which cause, what it costs, and what to do next."""
    texts = asked(result), explained(result), causes(result), cost(result), advice(result)
    return [f"{name + ':':<{WIDTH}}{text}" for name, text in zip(LINES, texts, strict=True)]


def asked(result: DiagnosisResult) -> str:
    """The question, in the words of who recorded."""
    what, parts = ("effort", "parts") if result.simulation == "axis" else ("force", "recordings")
    return (
        f"does the {result.simulation} simulation predict the {what} of {result.session} "
        f"({result.recordings} {parts}), and if not, why?"
    )


def explained(result: DiagnosisResult) -> str:
    """The share explained with its interval, and what keeps it from being the whole."""
    if result.verdict == "not judged":
        return result.statement
    return _share(result) + _remainder(result)


def _share(result: DiagnosisResult) -> str:
    share, error = result.explained_share, _error(result)
    if share is None and result.findings:
        return f"what is named takes little off the error of force{error}"
    if share is None:
        return f"no model tried does better than the simulation as it is{error}"
    return f"{_percent(share)} any model tried could take off the error{error}"


def _percent(share: Estimate) -> str:
    value, low, high = (f"{100 * part:.0f}" for part in (share.value, share.low, share.high))
    within = "" if low == high else f" ({low} to {high} %)"
    return f"{value} %{within} of what"


def _error(result: DiagnosisResult) -> str:
    """What the share is of."""
    if result.base_N is None or result.extended_N is None:
        return ""
    falls = (
        f", which {'falls' if result.explained_share else 'goes'} from {result.base_N:.2g} to {result.extended_N:.2g} N"
    )
    stays = f": the error is {result.extended_N:.2g} N"
    return f"{falls if result.findings else stays} ({result.floor_N:.2g} N could be reached)"


def _remainder(result: DiagnosisResult) -> str:
    """What is still left, which no model of the kind takes off; nothing where all is well."""
    if result.unexplained is None:
        return ""
    faults = []
    if result.noise_N and result.extended_N:
        faults.append(f"is {_times(result.extended_N / result.noise_N)} the noise")
    on = result.unexplained.depends_on
    if on:
        faults.append("differs between recordings" if on == ("recording",) else f"depends on {', '.join(on)}")
    gaps = "; the data have gaps" * any(finding.kind == "gap" for finding in result.data_quality)
    return f"; what is left {' and '.join(faults) or 'is no chance'}{gaps}"


def _times(ratio: float) -> str:
    return f"{ratio:.0f} times" if ratio >= 10 else f"{ratio:.2g} times"


def causes(result: DiagnosisResult) -> str:
    """The causes with size, unit and interval, or that none can be named."""
    if not result.findings:
        return "no cause can be named"
    certain = not any(finding.provisional for finding in result.findings)
    named = "; ".join(map(sized, result.findings))
    return named if certain else f"no cause can be named for certain; the likeliest: {named}"


def sized(finding: NamedCause) -> str:
    """A cause in words with its size, the interval of that, and what it cannot be told from."""
    _, size = first_size(finding)
    others = f", or {', '.join(finding.effects[1:])}" if finding.effects[1:] else ""
    return f"{finding.statement} ({_interval(size)}){others}" if size else f"{finding.statement}{others}"


def first_size(finding: NamedCause) -> tuple[str, Estimate | None]:
    """Name and estimate of the amplitude, which is the first of a cause's parameters."""
    return next(iter(finding.parameters.items()), ("", None))


def _interval(size: Estimate) -> str:
    bound = ", at its bound" if size.at_bound else ""
    return f"{size.low:.3g} to {size.high:.3g}{unit_after(size)}, 95 %{bound}"


def unit_after(size: Estimate) -> str:
    """The unit as it follows a number; nothing for a mere number."""
    return f" {size.unit}" if size.unit not in (None, "1") else ""


def cost(result: DiagnosisResult) -> str:
    """What the cause, or what is left, does to force and depth at the bench."""
    if result.axis is not None:
        return _cost_of_axis(result)
    if result.base_N is None or result.extended_N is None:
        return "unknown"
    if not result.findings:
        return f"the force is predicted within {_force_and_depth(result.extended_N, result)}{_own(result)}"
    wrong_N = sqrt(max(result.base_N**2 - result.extended_N**2, 0.0))
    if not wrong_N:
        return "none in force: a model without it predicts that as well"
    return f"a model without it gets the force wrong by {_force_and_depth(wrong_N, result)}{_own(result)}"


def _own(result: DiagnosisResult) -> str:
    """By how much recordings differ in what was fitted to each: no error of these, but one of the next."""
    told = ", ".join(f"{_amount(own)} in {CALLED.get(name, name)}" for name, own in result.scatter.items())
    return f"; from recording to recording it scatters by {told}" * bool(told)


def _amount(own: OwnSpread) -> str:
    return f"{100 * own.sd:.2g} %" if own.unit == "1" else f"{own.sd:.2g} {own.unit}"


def _force_and_depth(error_N: float, result: DiagnosisResult) -> str:
    if not result.stiffness_N_mm or error_N > THICKEST_MM * result.stiffness_N_mm:
        return f"{error_N:.2g} N rms"
    return f"{error_N:.2g} N rms, as much as {error_N / result.stiffness_N_mm:.2g} mm of depth"


def _cost_of_axis(result: DiagnosisResult) -> str:
    told = [
        f"without {finding.effects[0]} the effort is wrong by {_lost(finding)} {finding.gain.unit} rms"
        for finding in result.findings[:1]
    ]
    left = result.axis.left_out_percent if result.axis else None
    if left is not None:
        told.append(f"the effort of recordings left out is predicted to {left:.3g} %")
    return "; ".join(told) or "unknown"


def _lost(finding: NamedCause) -> str:
    before, after = finding.gain.errors
    return f"{sqrt(max(before**2 - after**2, 0.0)):.2g}"


def advice(result: DiagnosisResult) -> str:
    """What to do next: the repair of a certain cause, or what to record or to look at."""
    return "; ".join(_steps(result))


def _steps(result: DiagnosisResult) -> Iterator[str]:
    certain = [finding for finding in result.findings if not finding.provisional]
    yield from dict.fromkeys(finding.repair for finding in certain)
    if result.next_experiment:
        yield next_sentence(result.next_experiment)
    elif result.verdict == "adequate":
        yield "nothing to mend; the sizes that would have shown are listed below"
    elif not certain:
        yield "look at the picture of what is left before acting on a name, and record again where data are faulty"


def next_sentence(experiment: NextExperiment) -> str:
    """The next experiment, and how long it takes to tell its causes apart."""
    rate = experiment.nats_per_minute
    if rate is None:
        return experiment.do
    causes_apart = " from ".join(experiment.separates)
    if rate * LONGEST_MIN < SAFE_NATS:
        return f"no block of cycles tells {causes_apart} within an hour"
    return f"record {experiment.do}, repeated for {max(SAFE_NATS / rate, 1):.0f} min, which tells {causes_apart}"
