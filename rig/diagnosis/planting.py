"""From what size a cause would have been named: it is planted in a session's own recordings, and looked for there.

What a cause adds to the readings is worked out about the session's own model, and added to what was measured: tissue,
noise, scatter and protocol stay the session's own. A step of the search decides, flexible tissue too, then whole ones:
another cause may explain it better, and take its place.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.estimates import SmallestSize
from rig.diagnosis.evidence import tangents
from rig.diagnosis.families import with_families
from rig.diagnosis.fit import Fit, attempt, first_fit, fit, refreshed
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.noise import Array
from rig.diagnosis.observations import Observations, observe, sound_trials
from rig.diagnosis.other_forms import with_best_form
from rig.diagnosis.problem import Effect, Values
from rig.diagnosis.run import judged_trials
from rig.diagnosis.search import candidates, next_cause, search, testable
from rig.progress import Progress, silent
from rig.trials.trial import TrialSet

TRIALS, ENOUGH = 5, 4
CONFIRMED = 2  # a whole search takes as long as ten steps
# A whole number of sampling periods near it is 101 Hz or more: nothing that acts fast is lost, and much time is saved.
TRIED_RATE_HZ = 135.0
# Sizes grow from what the fit's curvature asks for, which knows nothing of flexible tissue, to seventeen times that; by
# a half each, which turns one found in five into four in five.
GROWTH, MOST_SIZES = 1.5, 8

Maxima = tuple[Array, Array]


@dataclass(frozen=True)
class Planting:
    """Where and how a cause is planted: a model of some of the recordings, the cause, its shape, its direction.

    ``direction`` has length 1 over the cause's amplitudes.
    """

    model: Fit
    effect: Effect
    shape: Values
    direction: Array

    def values(self, size: float) -> Values:
        """Of the cause's parameters at ``size``, in the unit of its amplitudes."""
        ways = zip(self.effect.amplitudes, self.direction, strict=True)
        return {**self.shape, **{par.name: par.null + size * float(way) for par, way in ways}}


def with_tried_sizes(found: Diagnosis, session: TrialSet, seed: int = 1, progress: Progress = silent) -> Diagnosis:
    """The diagnosis of ``session`` with sizes that were tried in place of estimates; what none showed gets a reason."""
    if found.search is None or not found.detectable:
        return found
    rng, sizes, reasons = np.random.default_rng(seed), dict[str, SmallestSize](), dict[str, str]()
    models = [model_of(part, found.search.after) for part in without_one(judged_trials(session))]
    for done, (name, estimate) in enumerate(found.detectable.items()):
        progress(f"planting {name}", done / len(found.detectable))
        variants = [effect for effect in testable(models[0].problem) if effect.name == name]
        plantings = [drawn(model, variants[0], rng, number % 2 == 0) for number, model in enumerate(models)]
        size = smallest_found(plantings, variants, estimate.minimum, found.search.maxima)
        if size is None:
            reasons[name] = f"planted in these recordings it was not found, up to {largest(variants[0], estimate)}"
        else:
            sizes[name] = size
    return replace(found, detectable=sizes, not_testable={**found.not_testable, **reasons})


def largest(effect: Effect, estimate: SmallestSize) -> str:
    """The largest size that was planted, with its unit."""
    return f"{min(GROWTH ** (MOST_SIZES - 1) * estimate.minimum, effect.amplitudes[0].high):.2g} {estimate.unit}"


def without_one(session: TrialSet) -> Iterator[Observations]:
    """The recordings but one, another one each time, at the slowest rate that shows what acts fast."""
    names = [trial.name for trial in sound_trials(session)[0]]
    for gone in np.linspace(0, len(names) - 1, TRIALS).round().astype(int):
        kept = tuple(trial for trial in session.trials if trial.name != names[gone])
        yield observe(replace(session, trials=kept), fastest_Hz=TRIED_RATE_HZ)


def model_of(data: Observations, model: Fit) -> Fit:
    """The same causes fitted to these readings."""
    assert isinstance(model.problem, IndentationProblem)
    return refreshed(fit(IndentationProblem(data, model.problem.simulation), model.effects, model.values))


def drawn(model: Fit, effect: Effect, rng: np.random.Generator, slow: bool) -> Planting:
    """One of the shapes looked for in noise, white or as ``slow`` as a breath, in any direction that it may take."""
    white = rng.standard_normal(len(model.prediction[0]))
    shapes = effect.shape_starts(model.problem, model.values, np.cumsum(white) if slow else white)
    way = rng.standard_normal(len(effect.amplitudes))
    way = way / np.linalg.norm(way)
    return Planting(model, effect, shapes[int(rng.integers(len(shapes)))], np.abs(way) if effect.one_sided else way)


def smallest_found(
    plantings: Sequence[Planting], variants: Sequence[Effect], estimate: float, maxima: Maxima
) -> SmallestSize | None:
    """The first of growing sizes that is found in enough of the plantings, and named; None where none in bounds is."""
    par = variants[0].amplitudes[0]
    for number in range(MOST_SIZES):
        size = GROWTH**number * estimate
        if size > par.high - par.null:
            return None
        found = count_found(plantings, variants, size, maxima)
        if found >= ENOUGH and all(is_named(planting, size) for planting in plantings[:CONFIRMED]):
            return SmallestSize(size, par.unit, found, len(plantings))
    return None


def count_found(plantings: Sequence[Planting], variants: Sequence[Effect], size: float, maxima: Maxima) -> int:
    """In how many the cause is found; counting ends where it can no longer be enough."""
    found = 0
    for number, planting in enumerate(plantings):
        if number - found > TRIALS - ENOUGH:
            break
        found += is_found(planting, size, variants, maxima)
    return found


def planted(planting: Planting, size: float) -> IndentationProblem:
    """The recordings of the model with what the cause adds to their readings."""
    model, problem = planting.model, planting.model.problem
    assert isinstance(problem, IndentationProblem)
    ahead = model.whitener.predict({**model.values, **planting.values(size)})
    force_N, *tip_mm = (after - before for after, before in zip(ahead, model.prediction, strict=True))
    data = replace(problem.data, force_N=problem.data.force_N + force_N)
    return replace(problem, data=replace(data, tip_mm=data.tip_mm + tip_mm[0]) if tip_mm else data)


def is_found(planting: Planting, size: float, variants: Sequence[Effect], maxima: Maxima) -> bool:
    """Whether a step of the search would take one of the variants into the model of what was planted."""
    model, problem = planting.model, planted(planting, size)
    again = attempt(problem, model.effects, model.values, replace(model.whitener, problem=problem))
    return again is not None and next_cause(candidates(again, tangents(again, variants)), again, maxima) is not None


def is_named(planting: Planting, size: float) -> bool:
    """Whether a whole search of what was planted, from the simulation as it is, has the cause in one of its sets."""
    problem = planted(planting, size)
    whole = search(problem, refreshed(first_fit(problem)), np.random.default_rng(0), silent)
    sets = ((one.effect.name, *one.alternatives, *one.family) for one in with_families(with_best_form(whole)).named)
    return any(planting.effect.name in names for names in sets)
