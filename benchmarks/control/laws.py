"""The law, its ablations and its rivals, each made for one subject on one plant."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from benchmarks.control import rival_tuning
from benchmarks.control.motion import Law
from benchmarks.control.plants import SUBJECTS, Plant, model_of, wiring_of
from benchmarks.control.rival_law import RivalColumns, RivalFeedback, RivalSettings
from benchmarks.control.rival_tuning import Shape, TissueAt, Tuning
from benchmarks.control.tried_law import GIVES_WAY_MM, TURNING_MM_S, TriedSettings
from controller.experiments import tracking
from controller.law import synthesis
from controller.law.axis_response import rates_of, response_of
from controller.law.inverse_model import Columns, GainRow, columns
from controller.law.loop_response import Constants
from controller.loop.steps import TrackForce

# A mass that answers a third as fast as the axis: what an admittance filters the sensor's noise with.
MASS_S = 0.015
NOISE_N = 0.005  # of the faster sensor's samples
VARY = 1.0  # damping halves where the error is all of the force: more, and the margins of the half would be lost


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
def tissue_of(shape: Shape, subject: str) -> TissueAt:
    """What a rival of this shape is tuned on."""
    return rival_tuning.tissue_at(shape, rows_of(subject), model_of(subject).damping_N_s_mm)


@lru_cache
def tuning_of(shape: Shape, subjects: tuple[str, ...], plant: Plant, drifts_rad_s: tuple[float, ...]) -> Tuning:
    """The best gains of a shape for one subject or for all at once."""
    wiring = wiring_of(plant)
    tissues = [tissue_of(shape, subject) for subject in subjects]
    return rival_tuning.tuned(response_of(wiring), rates_of(wiring), tissues, drifts_rad_s)


def pi(subject: str, plant: Plant, shape: Shape, tuning: Tuning, ahead: bool = True) -> Law:
    """PI with gains of ``shape``; ``ahead``: with inverse model, expectation and preview."""
    step, rows = track_step(subject, plant), rows_of(subject)
    integral = tuning.integral * rival_tuning.factors(shape, rows)
    force, depth, tangent, damping = map(np.array, columns(step.gains))
    table = RivalColumns(force, depth, tangent, damping, tuning.lead_s * integral, integral)
    inverse, feedback = step.settings
    inverse = inverse if ahead else inverse._replace(ahead_mm_s=0.0)
    rival = RivalFeedback(feedback, tuning.drift_rad_s, ahead, tuning.mass_s, VARY if tuning.mass_s else 0.0)
    return Law("rival", table, RivalSettings(inverse, rival), step.preview_s if ahead else 0.0)


def admittance(subject: str, plant: Plant) -> Law:
    """Admittance with variable damping, as robots for massage and ultrasound have it: one damper for a subject."""
    wiring = wiring_of(plant)
    tissue = tissue_of("constant", subject)
    slow = rival_tuning.fastest(response_of(wiring), rates_of(wiring), tissue, Tuning(1.0, 0.0, 0.0, MASS_S))
    return pi(subject, plant, "constant", slow._replace(integral=slow.integral / (1 + VARY)), ahead=False)


def constant(subject: str, plant: Plant, drift_rad_s: float | None = None) -> Law:
    """Constant PI tuned for this subject, with inverse model and second integral; the corner given, or the best."""
    drifts = rival_tuning.DRIFTS_RAD_S if drift_rad_s is None else (drift_rad_s,)
    return pi(subject, plant, "constant", tuning_of("constant", (subject,), plant, drifts))


def scheduled(subject: str, plant: Plant, shape: Shape) -> Law:
    """PI with gains of one over a stiffness, tuned for this subject."""
    return pi(subject, plant, shape, tuning_of(shape, (subject,), plant, rival_tuning.DRIFTS_RAD_S))


def for_all(subject: str, plant: Plant) -> Law:
    """One constant PI for all subjects."""
    return pi(subject, plant, "constant", tuning_of("constant", SUBJECTS, plant, rival_tuning.DRIFTS_RAD_S))


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
