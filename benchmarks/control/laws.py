"""The law, its ablations and its alternatives, each made for one subject on one plant."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from benchmarks.control.motion import Law
from benchmarks.control.plants import SUBJECTS, Plant, model_of, wiring_of
from benchmarks.control.tried_law import GIVES_WAY_MM, TURNING_MM_S, TriedSettings
from controller.experiments import tracking
from controller.law import synthesis
from controller.law.axis_response import rates_of, response_of
from controller.law.inverse_model import Columns, GainRow, columns
from controller.law.loop_response import Constants
from controller.loop.steps import TrackForce
from controller.simulated.alternatives import alternative_laws
from controller.simulated.alternatives.alternative_tuning import DRIFTS_RAD_S, Schedule, Tuning

NOISE_N = 0.005  # of the faster sensor's samples


class Ablation(NamedTuple):
    """What of the law is switched off."""

    inverse: bool = True
    leads: bool = True
    drift: bool = True
    restart: bool = True


ABLATIONS: Mapping[str, Ablation] = {
    "without leads": Ablation(leads=False),
    "without inverse model": Ablation(inverse=False),
    "without second integral": Ablation(drift=False),
    "without restart": Ablation(restart=False),
}


@lru_cache
def track_step(subject: str, plant: Plant) -> TrackForce:
    """The product's own step with its law."""
    return tracking.force_law(model_of(subject), wiring_of(plant))


def rows_of(subject: str) -> tuple[GainRow, ...]:
    """What laws take the tissue for."""
    return tracking.rows_of(model_of(subject))


def shaped(subject: str, plant: Plant, ablation: Ablation = Ablation()) -> Law:  # noqa: B008
    """The product's law, or what is left of it."""
    step = track_step(subject, plant)
    inverse, feedback = step.settings
    if not ablation.leads:
        feedback = feedback._replace(**_leadless(subject, plant)._asdict())
    if not ablation.drift:
        feedback = feedback._replace(drift_rad_s=0.0)
    if not ablation.restart:
        feedback = feedback._replace(lost_N=0.0)
    if not ablation.inverse:
        inverse = inverse._replace(ahead_mm_s=0.0)
    table = Columns(*map(np.array, columns(step.gains)))
    return Law("shaped", table, step.settings._replace(inverse=inverse, feedback=feedback), step.preview_s)


def tried(subject: str, plant: Plant, ahead_mm: float = 0.0, rests_below_N: float = 0.0) -> Law:
    """The product's law with friction compensation, or with a dead zone of its second integral."""
    law = shaped(subject, plant)
    settings = TriedSettings(law.settings, law.settings.inverse, ahead_mm, TURNING_MM_S, rests_below_N)
    return law._replace(kind="tried", settings=settings)


def _leadless(subject: str, plant: Plant) -> Constants:
    """The best constants with the lead at 0."""
    wiring = wiring_of(plant)
    axis, rates = response_of(wiring), rates_of(wiring)
    loop = tracking.loop_for(model_of(subject), wiring)
    one_lead = synthesis._fastest  # noqa: SLF001 - the product searches the lead too
    tried = [one_lead(axis, rates, loop.span, 0.0, share) for share in synthesis.SHARES]
    return max(tried, key=lambda law: law.crossover_rad_s * law.drift_rad_s)


@lru_cache
def tuning_of(schedule: Schedule, subjects: tuple[str, ...], plant: Plant, drifts_rad_s: tuple[float, ...]) -> Tuning:
    """The best gains of a schedule for one subject or for all at once."""
    steps = [track_step(subject, plant) for subject in subjects]
    return alternative_laws.tuning_for(steps, rates_of(wiring_of(plant)), schedule, drifts_rad_s)


def pi(subject: str, plant: Plant, schedule: Schedule, tuning: Tuning, ahead: bool = True) -> Law:
    """PI with gains by ``schedule``; ``ahead``: with inverse model, expectation and preview."""
    return Law("alternative", *alternative_laws.pi(track_step(subject, plant), schedule, tuning, ahead))


def admittance(subject: str, plant: Plant) -> Law:
    """Admittance with variable damping."""
    return Law("alternative", *alternative_laws.admittance(track_step(subject, plant), rates_of(wiring_of(plant))))


def constant(subject: str, plant: Plant, drift_rad_s: float | None = None) -> Law:
    """Constant PI tuned for this subject, with inverse model and second integral; the corner given, or the best."""
    drifts = DRIFTS_RAD_S if drift_rad_s is None else (drift_rad_s,)
    return pi(subject, plant, "constant", tuning_of("constant", (subject,), plant, drifts))


def scheduled(subject: str, plant: Plant, schedule: Schedule) -> Law:
    """PI with gains of one over a stiffness, tuned for this subject."""
    return pi(subject, plant, schedule, tuning_of(schedule, (subject,), plant, DRIFTS_RAD_S))


def for_all(subject: str, plant: Plant) -> Law:
    """One constant PI for all subjects."""
    return pi(subject, plant, "constant", tuning_of("constant", SUBJECTS, plant, DRIFTS_RAD_S))


def plain(subject: str, plant: Plant) -> Law:
    """PI on force alone, tuned for this subject."""
    return pi(subject, plant, "constant", tuning_of("constant", (subject,), plant, (0.0,)), ahead=False)


def leaves(subject: str, plant: Plant) -> Law:
    """No law: a tip that searches, and leaves at full speed with the first force that is felt."""
    return pi(subject, plant, "constant", Tuning(1e6, 0.0, 0.0), ahead=False)


Maker = Callable[[str, Plant], Law]
LAW = "law"
LEAVES = "leaves when touched"
# Not in the product: what they gain and cost is for the table to say.
TRIED: Mapping[str, Maker] = {
    "friction compensation": partial(tried, ahead_mm=GIVES_WAY_MM),
    "dead zone": partial(tried, rests_below_N=NOISE_N),
}
# Constants by the corner of their second integral [rad/s]: which is best depends on the test, and the best is taken.
CONSTANTS: Mapping[str, Maker] = {
    "constant": constant,
    "constant, no drift": lambda subject, plant: constant(subject, plant, 0.0),
    "constant, 0.5/s": lambda subject, plant: constant(subject, plant, 0.5),
}
OTHERS: Mapping[str, Maker] = {
    "one constant for all": for_all,
    "PI on the tangent": lambda subject, plant: scheduled(subject, plant, "tangent"),
    "the study's secant": lambda subject, plant: scheduled(subject, plant, "secant"),
    "variable admittance": admittance,
    "plain PI": plain,
}


def makers(names: Sequence[str] = ()) -> Mapping[str, Maker]:
    """All that are compared, or those named."""
    ablated: dict[str, Maker] = {name: partial(shaped, ablation=off) for name, off in ABLATIONS.items()}
    every: dict[str, Maker] = {LAW: shaped, **CONSTANTS, **OTHERS, **ablated, **TRIED, LEAVES: leaves}
    return {name: every[name] for name in names or tuple(every)[:-1]}
