"""Causes that lie in the tissue: its elastic law, relaxation, rate dependence, its surface chemistry."""

import numpy as np

from rig.diagnosis.effects.bench import ELASTIC
from rig.diagnosis.problem import Effect, Par
from rig.simulation.chain import Operator, Series, Tip, one
from rig.tissue.history import Term
from rig.tissue.index_law import Fields

REFERENCE_SPEED_MM_S = 10.0


def _relaxing(tip: Tip, force_N: Series, v: Fields) -> Series:
    term = Term(one(v, "relaxation_ratio"), one(v, "tau_s"))
    return tip.drive.history.respond(np.asarray(force_N), [term])


def _rate_law(tip: Tip, _: Series, v: Fields) -> Series:
    """B v0 |v/v0|^n with v0 = 10 mm/s in place of B v."""
    ratio = np.abs(tip.indenting_mm_s) / REFERENCE_SPEED_MM_S
    law = np.sign(tip.indenting_mm_s) * np.maximum(ratio, 1e-9) ** v["rate_exponent"]
    return np.asarray(v["damping_N_s_mm"] * REFERENCE_SPEED_MM_S * law)


def _preconditioned(tip: Tip, force_N: Series, v: Fields) -> Series:
    return force_N * (1 + v["preconditioning_gain"] * np.exp(-tip.drive.cycle / v["preconditioning_cycles"]))


def _warmed(tip: Tip, force_N: Series, v: Fields) -> Series:
    kelvin = tip.drive.temperature_C
    return force_N if kelvin is None else force_N * (1 + v["temperature_per_K"] * (kelvin - kelvin.mean()))


def _adhering(tip: Tip, force_N: Series, v: Fields) -> Series:
    """Pull on the way out, once the tip has touched: -Fad exp(-(d/l)^2)."""
    recording = tip.drive.recording + 1
    touched = np.maximum.accumulate(np.where(tip.depth_mm > 0, recording, 0)) == recording
    pull_N = -one(v, "adhesion_N") * np.exp(-((tip.depth_mm / one(v, "adhesion_length_mm")) ** 2))
    return np.asarray(force_N + pull_N * (touched & (tip.velocity_mm_s < 0)))


STIFFENING = Par("b_per_mm", "1/mm", 0.0, -0.5, 3.0, 0.02, least=0.005, meaning="growth of stiffness with depth")
RELAXATION_RATIO = Par(
    "relaxation_ratio", "1", 0.0, 0.0, 30.0, 0.02, least=0.005, may_end=True, meaning="transient over lasting force"
)
STIFFENING_EFFECT = Effect(
    "stiffening",
    "the tissue stiffens with depth: stiffness grows as exp(x {b_per_mm:.3g}/mm) instead of being constant",
    (STIFFENING,),
    one_sided=True,
    control=ELASTIC,
    repair="use the index model (stiffness as a function of depth) for gains and feed-forward",
)
ELASTIC_LAW = Effect(
    "elastic_law",
    "another elastic law fits better: a power law, growing with depth as x^{exponent:.3g} times the rest",
    (Par("exponent", "1", 1.0, 0.2, 4.0, 0.05, least=0.03, meaning="exponent n of (x / 5 mm)^(n-1)"),),
    through="depth",
    control=ELASTIC,
    repair="fit the law named here (`rig fit` offers it) and use it in place of the index law",
)
QUADRATIC_LAW = Effect(
    "elastic_law",
    "another elastic law fits better: a polynomial, with an extra factor 1 + {quadratic_per_mm:.3g} x",
    (Par("quadratic_per_mm", "1/mm", 0.0, -0.15, 50.0, 0.02, least=0.01, meaning="q of the factor 1 + q x"),),
    begin={"quadratic_per_mm": 0.4, "b_per_mm": 0.05},
    through="depth",
    control=ELASTIC,
    repair="fit the law named here (`rig fit` offers it) and use it in place of the index law",
)
SUBSTRATE = Effect(
    "substrate",
    "something stiff lies below: the force grows by 1 + {substrate_per_mm3:.3g} x^3",
    (Par("substrate_per_mm3", "1/mm^3", 0.0, 0.0, 0.05, 2e-4, least=2e-5, meaning="growth of force by depth cubed"),),
    one_sided=True,
    needs=frozenset({"depth"}),
    through="depth",
    control=ELASTIC,
    repair="measure over thicker tissue, stay shallower, or keep the substrate term in the model",
)
RELAXATION = Effect(
    "relaxation",
    "the tissue relaxes: a transient of {relaxation_ratio:.3g} times the lasting elastic force "
    "dies out in {tau_s:.3g} s",
    (RELAXATION_RATIO,),
    (Par("tau_s", "s", 1.0, 0.005, 100.0, 1.0, log=True, meaning="time constant"),),
    lambda *_: [{"tau_s": tau} for tau in (0.02, 0.06, 0.2, 0.6, 2.0, 6.0, 20.0)],
    begin={"relaxation_ratio": 1.0, "tau_s": 2.0, "b_per_mm": 0.05},
    one_sided=True,
    operator=Operator("relaxing", _relaxing),
    needs=frozenset({"depth"}),
    control="in the inverse model and, as sudden stiffness, in the gains",
    repair="use the model with relaxation; wait out the time constant before reading a static force",
)
RATE_LAW = Effect(
    "rate_law",
    "the viscous force does not grow in proportion to speed but as speed^{rate_exponent:.3g}",
    (Par("rate_exponent", "1", 1.0, 0.05, 2.5, 0.1, least=0.04, meaning="exponent of speed"),),
    operator=Operator("viscous", _rate_law),
    needs=frozenset({"speeds"}),
    control="its damping at 10 mm/s is in the gains and the inverse model",
    repair="use the power law of speed in the model",
)
PRECONDITIONING = Effect(
    "preconditioning",
    "the first cycles differ by {preconditioning_gain:.1%}, fading over {preconditioning_cycles:.2g} cycles",
    (Par("preconditioning_gain", "1", 0.0, -0.9, 3.0, 0.02, least=0.005, meaning="first cycle's gain over the last"),),
    (Par("preconditioning_cycles", "1", 3.0, 0.3, 30.0, 1.0, log=True, meaning="cycles to fade by 1/e"),),
    lambda *_: [{"preconditioning_cycles": n} for n in (1.0, 3.0, 8.0)],
    between=True,
    operator=Operator("elastic", _preconditioned),
    needs=frozenset({"strokes"}),
    repair="precondition with several cycles before recording, or leave the first ones out",
)
ADHESION = Effect(
    "adhesion",
    "the tip sticks on the way out with up to {adhesion_N:.3g} N over {adhesion_length_mm:.2g} mm",
    (Par("adhesion_N", "N", 0.0, 0.0, 10.0, 0.02, least=0.005, meaning="largest pull"),),
    (Par("adhesion_length_mm", "mm", 1.0, 0.05, 8.0, 1.0, log=True, meaning="reach of the pull"),),
    lambda *_: [{"adhesion_length_mm": length} for length in (0.2, 0.6, 2.0)],
    one_sided=True,
    operator=Operator("touch", _adhering),
    needs=frozenset({"unloading", "air"}),
    repair="powder or dry tip and skin; leave the last millimetre of the retraction out of a fit",
)
TEMPERATURE = Effect(
    "temperature",
    "the force changes by {temperature_per_K:.2%} per kelvin of the sensor's temperature",
    (Par("temperature_per_K", "1/K", 0.0, -0.3, 0.3, 0.005, least=0.001, meaning="relative change of force"),),
    between=True,
    operator=Operator("elastic", _warmed),
    needs=frozenset({"temperature"}),
    repair="let the sensor warm up, or calibrate its temperature coefficient",
)
TISSUE_EFFECTS = (ELASTIC_LAW, QUADRATIC_LAW, SUBSTRATE, RELAXATION, RATE_LAW, PRECONDITIONING, ADHESION, TEMPERATURE)
