"""Other forms: sessions whose formulas are not the engine's (`benchmarks.forms`)."""

from benchmarks.campaigns import questions as ask
from benchmarks.campaigns.campaign import Campaign, judged
from benchmarks.campaigns.case import AnswerFunction, Case, Record, Truth
from benchmarks.campaigns.counts import Goal, Question
from benchmarks.forms.draw import Draw, draw
from benchmarks.forms.session import Recording, Session
from rig.trials.trial import Trial, TrialSet


def case_of(seed: int) -> Case:
    """The session of a seed."""
    drawn = draw(seed)
    return Case(seed, drawn.kind, truth_of(drawn), lambda: session_of(drawn.record()))


def truth_of(drawn: Draw) -> Truth:
    """What is true of a session that was drawn."""
    return Truth(
        names=tuple(part.names for part in drawn.hidden if part.names),
        outside=any(not part.names for part in drawn.hidden),
        sizes={name: size for part in drawn.parts for name, size in part.sizes.items()},
        told=f"{', '.join(part.name for part in drawn.hidden) or 'nothing'} ({drawn.noise} noise, "
        f"{drawn.bench.rate_Hz:g} Hz)",
    )


def session_of(made: Session) -> tuple[TrialSet, float]:
    """The streams as the analysis takes them, and their noise [N]."""
    trials = tuple(_trial(number, one) for number, one in enumerate(made.recordings))
    return TrialSet("forms", trials), made.noise_N


def _trial(number: int, one: Recording) -> Trial:
    seen = one.marker_s.size > 0
    return Trial(
        f"trial_{number:02d}", one.force_s, one.force_N, one.axis_s, one.axis_mm, one.marker_s if seen else None,
        one.marker_mm if seen else None, speed_mm_s=one.speed_mm_s,
    )  # fmt: skip


def record(seed: int, answer: AnswerFunction) -> Record:
    """One session."""
    return judged(case_of(seed), answer)


FORMS = Campaign(
    record,
    (
        Question("sessions with a certain wrong name", Goal(high=0.01), ask.has_false_name),
        Question("something true in the answer, where anything was named", Goal(low=0.95), ask.holds_truth),
        Question("what the library does not hold flagged as unexplained", Goal(low=0.9), ask.flags_outside),
        Question("clean sessions with a certain name", Goal(high=0.02), ask.names_in_clean),
        Question("known sizes inside their 95 % intervals", Goal(0.9, 0.98), ask.covers),
        Question("each thing hidden in the answer, where anything was named", None, ask.holds_each),
        Question("anything named, of what the library holds", None, ask.finds),
        Question("sessions with a provisional wrong name", None, ask.has_false_hint),
        Question("clean sessions called adequate", None, ask.is_adequate_when_clean),
        Question("adequate or explained, the error left at the known noise", None, ask.leaves_noise_only),
        *ask.naive_questions(),
    ),
)
