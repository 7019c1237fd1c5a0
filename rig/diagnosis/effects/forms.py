"""Elastic laws that take the place of the index law, fitted where another form of it was named and never sought.

They are no step away from the index law: each holds its growth at nothing, and has a shape of its own.
"""

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from rig.diagnosis.effects.bench import ELASTIC
from rig.diagnosis.problem import Array, Effect, InverseProblem, Par, Values

GROWTH = frozenset({"b_per_mm"})
USE = "fit the law named here and use it in place of the index law"
THICKER = "measure over thicker tissue, stay shallower, or keep the layer in the model"
Starts = Callable[[InverseProblem, Values, Array], Sequence[Values]]


def _spread(name: str, low: float, high: float) -> Starts:
    return lambda *_: [{name: float(value)} for value in np.geomspace(low, high, 16)]


def _ogden_starts(*_: object) -> Sequence[Values]:
    pairs = product((0.02, 0.03, 0.045, 0.065, 0.09, 0.12), (1.5, 3.0, 5.0, 8.0, 12.0))
    return [{"ogden_per_mm": per_mm, "ogden_exponent": exponent} for per_mm, exponent in pairs]


def _law(statement: str, par: Par, starts: Starts, shapes: tuple[Par, ...] = (), name: str = "elastic_law") -> Effect:
    return Effect(
        name, statement, (par,), shapes, starts, one_sided=True, through="depth", holds=GROWTH, control=ELASTIC,
        repair=USE if name == "elastic_law" else THICKER,
    )  # fmt: skip


FUNG_LAW = _law(
    "another elastic law fits better: Fung's, a force that grows as exp({fung_per_mm:.3g} x) - 1",
    Par("fung_per_mm", "1/mm", 0.0, 0.0, 5.0, 0.02, least=0.01, meaning="rate b of a (exp(b x) - 1) / b"),
    _spread("fung_per_mm", 0.02, 2.0),
)
OGDEN_LAW = _law(
    "another elastic law fits better: Ogden's, a block of {ogden_per_mm:.3g} per mm of thickness, of exponent "
    "{ogden_exponent:.3g}",
    Par("ogden_per_mm", "1/mm", 0.0, 0.0, 0.5, 0.002, least=0.002, meaning="one over the thickness of the block"),
    _ogden_starts,
    (Par("ogden_exponent", "1", 4.0, 1.05, 40.0, 1.0, log=True, may_end=True, meaning="exponent of the stretch"),),
)
LAYER_LAW = _law(
    "the tissue is a layer on something stiff, pressed by a sphere: sqrt(R x) is {layer_ratio:.3g} times its thickness "
    "at 5 mm",
    Par("layer_ratio", "1", 0.0, 0.0, 8.0, 0.05, least=0.02, meaning="contact radius over thickness at 5 mm"),
    _spread("layer_ratio", 0.02, 4.0), name="substrate",
)  # fmt: skip
ELASTIC_FORMS = (FUNG_LAW, OGDEN_LAW, LAYER_LAW)
