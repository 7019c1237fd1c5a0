"""Hidden causes by the engine's own formulas: another program and integrator (`benchmarks.hidden`), the same laws."""

import numpy as np

from benchmarks.campaigns import questions as ask
from benchmarks.campaigns.campaign import Campaign, judged
from benchmarks.campaigns.case import AnswerFunction, Case, Record, Truth
from benchmarks.campaigns.counts import Goal, Question
from benchmarks.hidden.draw import KNOWN, UNKNOWN, Secret, draw_secret, recorded, session_of
from rig.trials.trial import TrialSet

KINDS = ("nothing", "one cause", "two causes", "unknown")


def secrets_of(kind: str, seed: int) -> list[Secret]:
    """What a session of this kind hides."""
    rng = np.random.default_rng([seed, 9 if kind == "two causes" else 5])
    if kind == "nothing":
        return []
    if kind == "two causes":
        return [draw_secret(rng, str(name)) for name in rng.choice(KNOWN, 2, replace=False)]
    names = KNOWN if kind == "one cause" else tuple(UNKNOWN)
    return [draw_secret(rng, names[seed // len(KINDS) % len(names)])]


def case_of(seed: int) -> Case:
    """The session of a seed; four in a row hold every kind."""
    kind = KINDS[seed % len(KINDS)]
    secrets = secrets_of(kind, seed)
    known = [secret for secret in secrets if secret.name in KNOWN]
    truth = Truth(
        names=tuple(frozenset({name}) for name in dict.fromkeys(name for secret in known for name in secret.causes)),
        outside=kind == "unknown",
        sizes={name: size for secret in known for name, size in secret.expected.items()},
        depends=frozenset().union(*(UNKNOWN.get(secret.name, ()) for secret in secrets)),
        told=", ".join(secret.name for secret in secrets) or "nothing",
    )
    return Case(seed, kind, truth, lambda: (_session(seed, secrets), None))


def _session(seed: int, secrets: list[Secret]) -> TrialSet:
    causes = {name: numbers for secret in secrets for name, numbers in secret.causes.items()}
    return session_of(*recorded(seed, Secret("all", causes, {})), stated="contact_offset" in causes)


def record(seed: int, answer: AnswerFunction) -> Record:
    """One session."""
    return judged(case_of(seed), answer)


HIDDEN = Campaign(
    record,
    (
        Question("clean sessions with a certain name", Goal(high=0.05), ask.names_in_clean),
        Question("each thing hidden in the answer, where anything was named", Goal(low=0.95), ask.holds_each),
        Question("sessions with a certain wrong name", Goal(high=0.05), ask.has_false_name),
        Question("what the library does not hold flagged as unexplained", Goal(low=0.9), ask.flags_outside),
        Question("flagged with the right variable", Goal(low=0.9), ask.flags_variable),
        Question("known sizes inside their 95 % intervals", Goal(0.9, 0.97), ask.covers),
        Question("anything named, of what the library holds", None, ask.finds),
        Question("clean sessions called adequate", None, ask.is_adequate_when_clean),
        *ask.naive_questions(),
    ),
    asks_confidence=True,
)
