"""Elastic laws of other forms in place of the one that was named: fitted to the end, compared as any two models are."""

from dataclasses import replace

import numpy as np

from rig.diagnosis.evidence import tangents
from rig.diagnosis.fit import Fit, attempt, held_values, level_of
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.noise import Array
from rig.diagnosis.problem import Effect, Values
from rig.diagnosis.search import (
    KEEP_NATS,
    Search,
    finished,
    gain_over,
    is_equal,
    proposed,
    score,
    settle,
    testable,
    within_reach,
)
from rig.tissue.index_law import extended_force

DEPTHS = 100  # of a curve of three parameters


def with_best_form(search: Search) -> Search:
    """The search's end with another elastic law in place of all that was named of it, where that predicts better.

    In place of two a law is taken that predicts as well.
    """
    after = search.after
    elastic = [effect for effect in after.effects if effect.is_elastic]
    # The contact of a law that is wrong may lie far off: the simulation as it was may have a better one.
    starts = (after, search.before) if elastic else ()
    tried = (refitted(after, form, start) for form in forms_for(after) for start in starts)
    fits = [found for found in tried if found is not None]
    if not fits:
        return search
    best = max(fits, key=lambda found: float(score(found).sum()))
    simpler = len(elastic) > 1 and is_equal(score(after) - score(best))
    if gain_over(best, after) <= KEEP_NATS and not simpler:
        return search
    p_values = {one.effect.name: one.p_value for one in search.named}
    p_values[best.names[-1]] = min(one.p_value for one in search.named if one.effect.is_elastic)
    named, final = settle(best, (), p_values)
    t = tangents(final, proposed(testable(final.problem), final.names))
    return replace(search, named=named, after=final, tangents=t)


def forms_for(model: Fit) -> list[Effect]:
    """Laws that may take the place of the simulation's."""
    base = {par.name for par in model.problem.base}
    return [effect for effect in model.problem.effects if effect.holds and effect.holds <= base]


def refitted(model: Fit, form: Effect, start: Fit) -> Fit | None:
    """The model with ``form`` in place of its elastic causes, from the law and contact of ``start``.

    None where its numbers run away, or where it is far behind.
    """
    kept = tuple(effect for effect in model.effects if not effect.is_elastic)
    enough = level_of(model) + within_reach(0.0)
    values = {**like(start, form), **{par.name: model.values[par.name] for effect in kept for par in effect.pars}}
    found = attempt(model.problem, (*kept, form), values, model.whitener, enough)
    return finished(found) if found is not None and level_of(found) >= enough else None


def like(model: Fit, form: Effect) -> Values:
    """Values at which ``form`` is nearest to the law of the model over its depths, in force."""
    problem = model.problem
    assert isinstance(problem, IndentationProblem)
    deepest_mm = float((problem.data.drive.position_mm - model.values["surface_mm"]).max())
    depth_mm = np.linspace(0, max(deepest_mm, 1e-3), DEPTHS + 1)[1:]
    wanted = extended_force(depth_mm, model.values)
    off = {par.name: par.null for effect in model.effects if effect.is_elastic for par in effect.pars}
    plain = {**model.values, **off, **held_values(problem, (form,)), "a_N_mm": 1.0}
    starts = [{**plain, **shape} for shape in form.shape_starts(problem, plain, wanted)]
    return min((_scaled(depth_mm, wanted, start) for start in starts), key=lambda pair: pair[0])[1]


def _scaled(depth_mm: Array, wanted: Array, values: Values) -> tuple[float, Values]:
    """What is left of a curve, and the values scaled to it."""
    curve = extended_force(depth_mm, values)
    scale = float(curve @ wanted) / float(curve @ curve)
    return float(np.sum((wanted - scale * curve) ** 2)), {**values, "a_N_mm": scale}
