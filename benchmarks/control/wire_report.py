"""Gains on the mock bench beside those of the same runs simulated, and which of them are no confirmation."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from benchmarks.control.goals import GOALS, JUMPS, LOW_JUMPS, PEAK
from benchmarks.control.laws import LAW
from benchmarks.control.plants import SUBJECTS
from benchmarks.control.scores import Gain, Score, gain_of, mean_of
from benchmarks.control.wire import BEST_AT_CONTACT, CONSTANT, WiredPart

# What is promised of a limb that moves, of low jumps and of jumps; a bench confirms what is within a third of it.
PROMISED = {
    **{f"limb 2 Hz, {force} N": least for force, least in GOALS.items()},
    "low jumps": LOW_JUMPS, "jumps": JUMPS,
}  # fmt: skip
CONFIRMED = 1 - 1 / 3
CONTACT = "contact, 0 mm/s"


class Confirmed(NamedTuple):
    """One headline: on the bench, simulated, and what is promised."""

    what: str
    subjects: int
    bench: Gain
    simulated: Gain
    promised: float

    @property
    def ratio(self) -> float:
        """Gain on the bench over that simulated."""
        return self.bench.value / self.simulated.value


def scores_of(found: Sequence[WiredPart], bench: bool) -> list[Score]:
    """Numbers of parts on the bench, or of their simulations."""
    return [
        Score(part.law, one.case, part.subject, part.seed, one.bench if bench else one.simulated)
        for part, numbers, _ in ((each.part, each.found, each.missed) for each in found)
        for one in numbers
    ]


def gains(found: Sequence[WiredPart]) -> Iterator[Confirmed]:
    """Of each headline over those subjects on whom both laws were measured in all of its cases."""
    for what, promised in PROMISED.items():
        cases = [what] if "limb" in what else [f"{what}, x{factor}" for factor in ("0.5", "2")]
        both = [_of(scores_of(found, bench), cases) for bench in (True, False)]
        if both[0]:
            subjects = len({score.subject for score in both[0]})
            bench, simulated = (gain_of(scores, CONSTANT, cases) for scores in both)
            yield Confirmed(what, subjects, bench, simulated, promised)


def _of(scores: Sequence[Score], cases: Sequence[str]) -> list[Score]:
    """Of these cases, the subjects and seeds that have all of both laws."""
    wanted = {(law, case) for law in (LAW, CONSTANT) for case in cases}
    there: dict[tuple[str, int], set[tuple[str, str]]] = {}
    for score in scores:
        there.setdefault((score.subject, score.seed), set()).add((score.law, score.case))
    whole = {run for run, has in there.items() if wanted <= has}
    return [score for score in scores if (score.subject, score.seed) in whole and (score.law, score.case) in wanted]


def missed(confirmed: Sequence[Confirmed], peak: float | None) -> list[str]:
    """Headlines that the bench does not confirm, one sentence each."""
    sentences = [
        f"{one.what}: {one.bench.value:.2f}x on the bench, less than two thirds of the {one.promised:g}x promised"
        for one in confirmed
        if one.bench.value < CONFIRMED * one.promised
    ]
    if peak is not None and not peak <= PEAK:
        sentences.append(f"{CONTACT}: the peak is {peak:.3f} of what is asked for on the bench, promised {PEAK:g}")
    return sentences


def lacking(found: Sequence[WiredPart]) -> list[str]:
    """Headlines that were not measured on every subject, one sentence each: what was not played confirms nothing."""
    subjects = {one.what: one.subjects for one in gains(found)}
    touched = {one.part.subject for one in found if (one.part.kind, one.part.law) == ("contact", LAW)}
    subjects[CONTACT] = len(touched)
    return [
        f"{what}: measured on {subjects.get(what, 0)} of {len(SUBJECTS)} subjects"
        for what in (*PROMISED, CONTACT)
        if subjects.get(what, 0) < len(SUBJECTS)
    ]


def show(found: Sequence[WiredPart]) -> list[str]:
    """Prints both, case by case and as gains; returns what is not confirmed."""
    for bench, where in ((True, "bench"), (False, "simulated")):
        scores = scores_of(found, bench)
        for law, case in sorted({(score.law, score.case) for score in scores}):
            mean = mean_of(scores, law, [case])
            print(f"{where:10} {case:22} {law:20} {mean.value:8.4f} +- {mean.within:.4f} (worst {mean.worst:.4f})")
    confirmed = list(gains(found))
    for one in confirmed:
        spread = f"{one.bench.value:6.2f} ({one.bench.low:.2f} to {one.bench.high:.2f})"
        print(f"{one.what:18} {one.subjects} subjects: bench {spread}, simulated {one.simulated.value:.2f}, ratio"
              f" {one.ratio:.2f}, promised {one.promised:g}")  # fmt: skip
    print(f"slots of the loop missed: {sum(one.missed for one in found)} in {len(found)} runs")
    touched = [score for score in scores_of(found, True) if score.case == CONTACT]
    peaks = {law: mean_of(touched, law, [CONTACT]).worst for law in (LAW, CONSTANT, BEST_AT_CONTACT)
             if any(score.law == law for score in touched)}  # fmt: skip
    print("contact, worst subject:", ", ".join(f"{law} {peak:.3f}" for law, peak in peaks.items()))
    sentences = [*missed(confirmed, peaks.get(LAW)), *lacking(found)]
    for sentence in sentences:
        print("NOT CONFIRMED:", sentence)
    return sentences
