"""Causes that one session cannot tell apart: all that any elastic law of the tissue does as well.

Elastic laws differ in one variable, the depth, so monotone splines of it stand for all of them at once. How much of a
cause they take is computed from the tangents of the final model, contact and relaxation and bench in between.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from rig.diagnosis.evidence import white_direction
from rig.diagnosis.fit import Fit
from rig.diagnosis.flexible import ROOM, Basis
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.noise import Array
from rig.diagnosis.problem import Effect
from rig.diagnosis.search import Named, Search, testable
from rig.diagnosis.support import stands_on_any_law
from rig.diagnosis.whitening import shifted

# Of the evidence for a cause: what another elastic law leaves of it is then less than what that law takes.
MOST_TAKEN = 0.5
STEP_SHARE = 1e-3  # of the law's force, for the slope over a spline's height
FORM = "elastic_law"


def with_families(search: Search) -> Search:
    """Each name with those that stand for the same: the form of the elastic law, where that takes most of it.

    A cause that is an elastic law itself stands for all others of which that is so.
    """
    after = search.after
    if not isinstance(after.problem, IndentationProblem) or not search.named:
        return search
    elastic = [cause for cause in testable(after.problem) if cause.is_elastic]
    taken = taken_by_elasticity(after, {cause.key: cause for cause in (*after.effects, *elastic)}.values())
    likes = [FORM, *(cause.name for cause in elastic if taken.get(cause.key, 0.0) > MOST_TAKEN)]
    named = [
        _beside(one, likes if one.effect.is_elastic else [FORM]) if taken.get(one.effect.key, 0.0) > MOST_TAKEN else one
        for one in search.named
    ]
    return replace(search, named=tuple(named))


def on_any_law(one: Named, after: Fit) -> Named:
    """The name, and where it does not stand on an elastic law of any form, that form as what else it may be."""
    if stands_on_any_law(after, one.effect):
        return one
    return replace(one, stands=False, alternatives=tuple(dict.fromkeys((*one.alternatives, FORM))))


def _beside(one: Named, names: list[str]) -> Named:
    return replace(one, family=tuple(dict.fromkeys(name for name in names if name != one.effect.name)))


def taken_by_elasticity(fit: Fit, effects: Iterable[Effect]) -> dict[str, float]:
    """What share of each effect's information any elastic law takes once all else is fitted again, by the effect's key.

    Effects of the model are taken at their size, others at their null; none that stands on a bound is listed.
    """
    place = {par.name: k for k, par in enumerate(fit.free)}
    splines, shares = elastic_columns(fit), dict[str, float]()
    for effect in effects:
        if effect.key in {own.key for own in fit.effects}:
            own = [place[par.name] for par in effect.amplitudes if par.name in place]
            columns, model = fit.jacobian[:, own], np.delete(fit.jacobian, own, axis=1)
        else:
            found = [white_direction(fit, effect, par.name, {}) for par in effect.amplitudes]
            columns, model = np.stack(found, axis=1), fit.jacobian
        left = power_left(columns, model)
        if left > 0:
            shares[effect.key] = 1 - power_left(columns, np.hstack([model, splines])) / left
    return shares


def power_left(columns: Array, model: Array) -> float:
    """Power of ``columns`` (n, k) that no sum of those of ``model`` (n, p) takes off."""
    scaled = model / np.maximum(np.linalg.norm(model, axis=0), 1e-300)
    return float(np.sum((columns - scaled @ np.linalg.lstsq(scaled, columns, rcond=1e-9)[0]) ** 2))


def elastic_columns(fit: Fit) -> Array:
    """White change of all channels for each spline of depth in the tissue's law at rest, shape (n, splines).

    It bends the law that the causes act on: beside a force that a cause scales, none of it may be left unscaled.
    """
    problem = fit.problem
    assert isinstance(problem, IndentationProblem)
    values = shifted(problem, fit.values, fit.whitener.noise.shifts)
    depth_mm = problem.data.drive.position_mm - values["surface_mm"] - values["contact_offset_mm"]
    depths, splines = Basis(problem.data.drive, ROOM * max(float(depth_mm.max()), 1e-3)).table
    found = []
    for spline in splines.T:
        bent = problem.predict({**values, "bend_mm": depths, "bend": STEP_SHARE * spline})
        found.append(fit.whitener([(a - b) / STEP_SHARE for a, b in zip(bent, fit.prediction, strict=True)]))
    return np.stack(found, axis=1)
