"""Causes that lie in the tissue: its elastic law, rate dependence, softening, its surface chemistry."""

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.special import erf

from rig.diagnosis.effects.bench import ELASTIC
from rig.diagnosis.problem import Effect, Par
from rig.simulation.chain import TANGENT_MM, Operator, Series, Tip, one
from rig.simulation.drive import SETTLE_MM_S
from rig.tissue.index_law import Fields, extended_force

REFERENCE_SPEED_MM_S = 10.0
ENERGY_STEPS = 200  # of a strain energy over depth: 0.02 % of it by the trapezoid rule


def _rate_law(tip: Tip, _: Series, v: Fields) -> Series:
    """B v0 |v/v0|^n with v0 = 10 mm/s in place of B v; straight where the tip stands still.

    A power below one would make a force of the encoder's noise there.
    """
    speed_mm_s = np.maximum(np.abs(tip.indenting_mm_s), SETTLE_MM_S)
    law = (speed_mm_s / REFERENCE_SPEED_MM_S) ** (v["rate_exponent"] - 1)
    return np.asarray(v["damping_N_s_mm"] * tip.indenting_mm_s * law)


def _damped_by_depth(tip: Tip, force_N: Series, v: Fields) -> Series:
    """lambda v times the force at rest, beside the viscous force (Hunt and Crossley 1975)."""
    at_rest_N = extended_force(np.maximum(tip.depth_mm, 0.0), v)
    return np.asarray(force_N + v["hunt_crossley_s_mm"] * tip.indenting_mm_s * at_rest_N)


def _softened(tip: Tip, force_N: Series, v: Fields) -> Series:
    """Less by share x erf((W_most - W) / m): W is the strain energy at rest (Ogden and Roxburgh 1999, eq. 34).

    ``m`` is in shares of the session's largest energy; what was reached in one recording is remembered in all later.
    """
    depth_mm = np.maximum(tip.depth_mm, 0.0)
    grid_mm = np.linspace(0.0, max(float(depth_mm.max()), TANGENT_MM), ENERGY_STEPS)
    energy = cumulative_trapezoid(extended_force(grid_mm, {**v, "a_N_mm": 1.0}), grid_mm, initial=0)
    reached = np.interp(depth_mm, grid_mm, energy / energy[-1])
    below = np.maximum.accumulate(reached) - reached
    return np.asarray(force_N * (1 - one(v, "mullins_share") * erf(below / one(v, "mullins_energy"))))


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
RATE_LAW = Effect(
    "rate_law",
    "the viscous force does not grow in proportion to speed but as speed^{rate_exponent:.3g}",
    (Par("rate_exponent", "1", 1.0, 0.05, 2.5, 0.1, least=0.04, meaning="exponent of speed"),),
    operator=Operator("viscous", _rate_law),
    needs=frozenset({"speeds"}),
    control="its damping at 10 mm/s is in the gains and the inverse model",
    repair="use the power law of speed in the model",
)
HUNT_CROSSLEY = Effect(
    "hunt_crossley",
    "damping grows with depth: the elastic force is larger by {hunt_crossley_s_mm:.3g} of itself for each mm/s",
    # 0.0005 are half a percent of the force at 10 mm/s.
    (Par("hunt_crossley_s_mm", "s/mm", 0.0, 0.0, 1.0, 0.002, least=0.0005, meaning="damping over elastic force"),),
    one_sided=True,
    operator=Operator("viscous", _damped_by_depth),
    needs=frozenset({"depth", "unloading"}),
    repair="use a Hunt-Crossley law (`rig fit` offers it) in place of the constant damper",
)
MULLINS = Effect(
    "mullins",
    "the tissue softens by what it has borne: up to {mullins_share:.1%} less force below the deepest depth so far",
    (Par("mullins_share", "1", 0.0, 0.0, 0.95, 0.02, least=0.01, meaning="largest loss of force, 1/r"),),
    (Par("mullins_energy", "1", 0.3, 0.02, 5.0, 1.0, log=True, meaning="m over the session's largest strain energy"),),
    lambda *_: [{"mullins_energy": energy} for energy in (0.08, 0.4, 1.5)],
    one_sided=True,
    operator=Operator("elastic", _softened),
    needs=frozenset({"depth", "unloading"}),
    repair="press once deeper than the protocol goes before recording, and never deeper afterwards",
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
TISSUE_EFFECTS = (
    ELASTIC_LAW, QUADRATIC_LAW, SUBSTRATE, RATE_LAW, HUNT_CROSSLEY, MULLINS, PRECONDITIONING, ADHESION, TEMPERATURE,
)  # fmt: skip
