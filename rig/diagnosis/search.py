"""From nothing to a set of named causes: forward steps, backward drop, swap pass, alternatives of the final model."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rig.diagnosis.descent import on_bound
from rig.diagnosis.evidence import (
    Direction,
    Tangents,
    amplitudes_of,
    chance,
    chance_maxima,
    held_out_log_density,
    is_alias,
    linear_gains,
    tangents,
)
from rig.diagnosis.fit import (
    Fit,
    attempt,
    best_fit,
    fit,
    level_of,
    low_noise_refit,
    low_noise_view,
    refreshed,
    trial_fit,
)
from rig.diagnosis.lack_of_fit import LEVEL, assess_lack_of_fit
from rig.diagnosis.noise import Array
from rig.diagnosis.problem import Effect, InverseProblem, Values
from rig.diagnosis.support import Support, support_of
from rig.progress import Progress

ALPHA = 0.03  # of 5 % of false alarms allowed; the rest is for the test of lack of fit and for the noise's fit
SHORT_LIST = 5
MOST_EFFECTS = 3  # one more than the benchmark hides together
ALTERNATIVE_SE = 2.0  # 95 % of a normal: an alternative within it predicts as well
KEEP_NATS = 3.0  # odds of 20 to 1 (e^3)
START_SCALES = 0.05  # off the null by so little that the model is not worse for it, and its noise stays small
STANDS_OUT_NATS = 3.0  # odds of 20 to 1 (e^3)
FOLLOWED = 5
# On hidden causes refitting added up to 20 nats to most small gains, and friction, the best at last, began at 0.57 of
# the first's gain.
REACH_NATS = 20.0
REACH_SHARE = 0.5


@dataclass(frozen=True)
class Named:
    """One effect of the final model: its alternatives, held-out gain by recording over the best model without it.

    ``support`` is what decides whether it is named. ``family`` are names that act through the same variable; it
    ``stands`` where any other elastic law leaves it.
    """

    effect: Effect
    alternatives: tuple[str, ...]
    gains: Array
    p_value: float
    without: Fit
    share: float
    support: Support
    family: tuple[str, ...] = ()
    stands: bool = True

    @property
    def nats(self) -> float:
        """The whole gain."""
        return float(self.gains.sum())


@dataclass(frozen=True)
class SearchStep:
    """Gain [nats] of each cause tried beside those before, what chance reaches once in twenty, and which was taken."""

    gains: Mapping[str, float]
    level: float
    taken: str | None


@dataclass(frozen=True)
class Search:
    """What was found: the models before and after, its effects, the last step's view of the rest, and every step."""

    before: Fit
    after: Fit
    named: tuple[Named, ...]
    tangents: Tangents
    maxima: tuple[Array, Array]
    steps: tuple[SearchStep, ...]


def testable(problem: InverseProblem) -> list[Effect]:
    """Effects whose needs the data meet, that are steps away from the simulation."""
    return [effect for effect in problem.effects if not (effect.holds or effect.needs & problem.offers.keys())]


def proposed(library: Sequence[Effect], names: Collection[str]) -> list[Effect]:
    """Effects that may be next beside those of these names."""
    return [e for e in library if e.name not in names and (not e.beside or e.beside in names)]


def penalty(effect: Effect, problem: InverseProblem) -> float:
    """Nats taken off for having scanned many shapes."""
    return float(np.log(effect.tries(problem)))


def screen(t: Tangents, problem: InverseProblem) -> list[tuple[float, Direction]]:
    """Best direction of each effect by linear held-out gain, best effect first; structural aliases left out."""
    gains = linear_gains(t, t.gradient[None])[0]
    best: dict[str, tuple[float, Direction]] = {}
    for gain, direction in zip(gains, t.directions, strict=True):
        name = direction.effect.key
        if np.isfinite(gain) and not is_alias(t, direction) and gain > best.get(name, (-np.inf, direction))[0]:
            best[name] = (float(gain), direction)
    ranked = [(gain - penalty(direction.effect, problem), direction) for gain, direction in best.values()]
    return sorted(ranked, key=lambda item: -item[0])


def starting_values(current: Fit, direction: Direction, t: Tangents) -> dict[str, float]:
    """Values with one more effect just off its null, to the side the data ask for.

    A start at the linear estimate with all else unmoved would be a worse model than the current one, and noise
    estimated there would hide the effect. What the mean of a scatter may be starts there.
    """
    start = {**current.values, **direction.shape}
    for par, value in zip(direction.effect.amplitudes, amplitudes_of(t, direction), strict=True):
        start[par.name] = par.null + float(np.clip(value, -START_SCALES * par.scale, START_SCALES * par.scale))
    for k, scatter in enumerate(current.problem.scatter):
        if scatter.name == direction.effect.mean_of:
            start[direction.effect.amplitudes[0].name] = float(current.whitener.noise.shifts[:, k].mean())
    return start


def score(model: Fit) -> Array:
    """Held-out log density by recording, less what scans cost, shape (recordings,)."""
    cost = sum(penalty(effect, model.problem) for effect in model.effects)
    return held_out_log_density(model) - cost / model.problem.recordings


def gain_over(model: Fit, other: Fit) -> float:
    """By how many nats a model predicts recordings left out better than another."""
    return float((score(model) - score(other)).sum())


def candidates(current: Fit, t: Tangents, other: Fit | None = None) -> list[Fit]:
    """Effects that may be next, jointly refitted, best first; beside ``other``, another model of as many, only others.

    Tried are those within reach of the best by the linear gain, whatever may pass for scatter, and, where anything
    stands out, the best of a rescreening under noise too small to have swallowed them.
    """
    problem, ranked = current.problem, screen(t, current.problem)
    top = ranked[0][0] if ranked else 0.0
    reach, known = max(within_reach(top), 0.0), {effect.key for effect in other.effects} if other else set[str]()
    if all(d.effect.key in known for d in t.directions):
        return []
    near = [d for gain, d in ranked[:SHORT_LIST] if gain > reach and d.effect.key not in known]
    near += [d for _, d in ranked if d.effect.between and d not in near and d.effect.key not in known]
    starts = [((*current.effects, d.effect), starting_values(current, d, t)) for d in near]
    race = Race(current, other)
    for effects, start in starts:
        race.enter(attempt(problem, effects, start, current.whitener, race.enough))
    loud = top > STANDS_OUT_NATS or assess_lack_of_fit(current, np.random.default_rng(0)).p_value <= LEVEL
    for effects, start in starts:
        if not loud or effects[-1].mean_of:
            race.enter(low_noise_refit(problem, effects, start, current.whitener, race.enough))
    if loud:
        rescreen(current, t, race, known)
    living = [c for c in race.entered if is_sizeable(c.effects[-1], c.values)]
    gains = [gain_over(c, current) for c in living]
    best = max([*gains, gain_over(other, current) if other else 0.0])
    polished = [finished(c) if gain > within_reach(best) else c for c, gain in zip(living, gains, strict=True)]
    polished = [c for c in polished if is_sizeable(c.effects[-1], c.values)]
    return sorted(polished, key=lambda candidate: -float(score(candidate).sum()))


class Race:
    """Candidates for the next effect as they come, and the log likelihood below which none is worth another round."""

    def __init__(self, current: Fit, other: Fit | None) -> None:
        self.level = level_of(current)
        self.best = level_of(other) - self.level if other else -np.inf
        self.entered: list[Fit] = []

    @property
    def enough(self) -> float:
        """As far behind the best as what refitting may add."""
        return self.level + within_reach(self.best) if np.isfinite(self.best) else -np.inf

    def enter(self, candidate: Fit | None) -> None:
        """One more, unless its numbers ran away."""
        if candidate is not None:
            self.entered.append(candidate)
            self.best = max(self.best, level_of(candidate) - self.level)


def finished(candidate: Fit) -> Fit:
    """The candidate fitted to the end."""
    return fit(candidate.problem, candidate.effects, candidate.values, candidate.whitener)


def rescreen(current: Fit, t: Tangents, race: Race, known: Collection[str]) -> None:
    """Fits from noise too small to have swallowed an effect: of the best, every peak of a scan, second beginnings.

    All are brought to their best under the same noise first; those that explain most there are fitted to the end.
    """
    problem, quiet = current.problem, low_noise_view(current)
    effects = [e for e in {d.effect.key: d.effect for d in t.directions}.values() if e.key not in known]
    quiet_t = tangents(quiet, effects)
    best = [d for gain, d in screen(quiet_t, problem)[:SHORT_LIST] if gain > 0]
    # Cycles that repeat alias one frequency into another: every peak is followed to its end.
    best += [d for d in quiet_t.directions if d.effect.tries(problem) > 1 and d not in best]
    starts = [(d.effect, starting_values(quiet, d, quiet_t)) for d in best]
    free = {par.name for par in problem.base}
    for effect in (effect for effect in effects if effect.begin):
        own = free | {par.name for par in effect.pars}
        begin = {name: value for name, value in effect.begin.items() if name in own}
        starts.append((effect, {**current.values, **begin}))
    ends = [(effect, trial_fit(problem, (*current.effects, effect), start, quiet.whitener)) for effect, start in starts]
    furthest = sorted(((effect, *end) for effect, end in ends if end is not None), key=lambda end: -end[2])
    for effect, values, _ in furthest[:FOLLOWED]:
        race.enter(low_noise_refit(problem, (*current.effects, effect), values, current.whitener, race.enough))


def within_reach(best: float) -> float:
    """Gain above which a candidate might still be as good as the best."""
    return best - max(REACH_NATS, REACH_SHARE * best)


def is_sizeable(effect: Effect, values: Values) -> bool:
    """Whether the effect is of the smallest size of interest or more, and inside its bounds."""
    size = float(np.hypot.reduce([values[p.name] - p.null for p in effect.amplitudes]))
    ended = any(on_bound(p, values[p.name]) and not p.may_end for p in effect.pars)
    return size >= effect.amplitudes[0].least and not ended


def search(problem: InverseProblem, before: Fit, rng: np.random.Generator, progress: Progress) -> Search:
    """Forward steps while the best gain beats chance at ALPHA / 2^k, then drop and swap, then alternatives."""
    current, steps, p_values, alone = before, list[SearchStep](), dict[str, float](), True
    library = testable(problem)
    for step in range(MOST_EFFECTS + 1):
        progress(f"step {step + 1}: {len(library) - len(current.effects)} causes", 0.15 + 0.15 * step)
        t = tangents(current, proposed(library, current.names))
        maxima = chance_maxima(t, rng)
        # What two causes through one variable leave, a third cannot name.
        found = [] if shared_variables(current.effects) else candidates(current, t)
        # Best first, so that of several beginnings of one cause the best stands in the table.
        gains = {c.names[-1]: gain_over(c, current) for c in reversed(found)}
        chosen = next_cause(found, current, maxima) if step < MOST_EFFECTS else None
        steps.append(SearchStep(gains, chance_level(maxima), chosen.names[-1] if chosen else None))
        if chosen is None:
            break
        p_values[chosen.names[-1]] = chance(maxima, gains[chosen.names[-1]])
        best = max(gains.values())
        alone = alone and sum(gain > within_reach(best) for gain in gains.values()) == 1
        current = refreshed(chosen)
    progress("drop and swap", 0.8)
    current = drop_unsupported(current)
    if not current.effects and gain_over(current, before) > KEEP_NATS:
        # Taking the cause away led the simulation to a better fit than it had begun with: begin there.
        return search(problem, current, rng, progress)
    # A single cause far beyond all others has no alternatives; with more than one the order of naming may mislead.
    named, current = settle(current, library if len(current.effects) > 1 or not alone else (), p_values)
    if current.names != tuple(p_values):
        t = tangents(current, proposed(library, current.names))
        maxima = chance_maxima(t, rng)
    return Search(before, current, named, t, maxima, tuple(steps))


def chance_level(maxima: tuple[Array, Array]) -> float:
    """The gain [nats] that chance reaches once in twenty."""
    return max((float(np.quantile(drawn, 0.95)) for drawn in maxima if drawn.size), default=0.0)


def next_cause(found: Sequence[Fit], current: Fit, maxima: tuple[Array, Array]) -> Fit | None:
    """The best candidate that beats chance and whose name is supported, if any."""
    level = ALPHA / 2 ** len(current.effects)
    return first_supported([c for c in best_of_each(found) if chance(maxima, gain_over(c, current)) <= level], current)


def best_of_each(found: Sequence[Fit]) -> list[Fit]:
    """Of several beginnings of one cause the best, as they come."""
    best = dict[str, Fit]()
    for candidate in found:
        best.setdefault(candidate.names[-1], candidate)
    return list(best.values())


def first_supported(found: Sequence[Fit], current: Fit) -> Fit | None:
    """The best of the candidates whose name is supported: what only seemed to be the best stands in no other's way."""
    best = gain_over(found[0], current) if found else 0.0
    for candidate in found[:FOLLOWED]:
        far = gain_over(candidate, current) <= within_reach(best)
        whole = finished(candidate) if far else candidate
        if is_sizeable(whole.effects[-1], whole.values) and support_of(whole, whole.effects[-1], current).holds:
            return whole
    return None


def shared_variables(effects: Sequence[Effect]) -> tuple[str, ...]:
    """Variables two or more of the effects act through alone: together they fit any curve, so they name nothing."""
    variables = [effect.through for effect in effects if effect.through]
    return tuple(dict.fromkeys(name for name in variables if variables.count(name) > 1))


def without(model: Fit, name: str) -> Fit:
    """The model refitted with one effect less, and without those that mean nothing without it."""
    names = {name}
    for effect in model.effects:
        names |= {effect.name} if effect.beside in names else set()
    kept = tuple(effect for effect in model.effects if effect.name not in names)
    gone = [effect for effect in model.effects if effect.name in names]
    start = {**model.values, **{par.name: par.null for effect in gone for par in effect.pars}}
    held = frozenset[str]().union(*(effect.holds for effect in gone))
    if held:
        start |= {name: value for name, value in model.problem.start().items() if name in held}
    return best_fit(model.problem, kept, start, model.whitener) or fit(model.problem, kept, start, model.whitener)


def drop_unsupported(model: Fit) -> Fit:
    """Without the effects that stopped earning their place, or shrank below it, once others had joined."""
    # What means nothing without another goes before it.
    for effect in sorted(model.effects, key=lambda effect: not effect.beside):
        smaller = without(model, effect.name)
        if not is_sizeable(effect, model.values) or gain_over(model, smaller) < KEEP_NATS:
            return drop_unsupported(smaller)
    return model


def settle(model: Fit, library: Sequence[Effect], p_values: dict[str, float]) -> tuple[tuple[Named, ...], Fit]:
    """After the swaps, without what earns nothing, and what is not supported."""
    named, model = swap(model, library, p_values)
    weak = [one for one in named if one.nats < KEEP_NATS or not one.support.holds]
    if not weak:
        return named, model
    return settle(min(weak, key=lambda one: one.nats).without, (), p_values)


def swap(model: Fit, library: Sequence[Effect], p_values: dict[str, float]) -> tuple[tuple[Named, ...], Fit]:
    """Every effect against all others in its place; a better one takes it, an equal one is an alternative."""
    for swaps_left in (2, 1, 0):
        named, better = [], None
        for effect in model.effects:
            smaller = without(model, effect.name)
            t = tangents(smaller, proposed(library, smaller.names))
            others = candidates(smaller, t, model)
            p = p_values.get(effect.name, 1 / 401)
            named.append(_named(model, effect, smaller, others, p))
            if others and gain_over(others[0], model) > KEEP_NATS:
                better = others[0]
        if better is None or not swaps_left:
            break
        model = better
    return tuple(named), model


def _named(model: Fit, effect: Effect, smaller: Fit, others: Sequence[Fit], p_value: float) -> Named:
    mine = score(model)
    alternatives = [c for c in others if is_equal(mine - score(c)) and gain_over(c, smaller) > 0]
    table = np.stack([mine, *[score(c) for c in alternatives]])
    names = dict.fromkeys(c.names[-1] for c in alternatives if c.names[-1] != effect.name)
    support = support_of(model, effect, smaller)
    return Named(effect, tuple(names), mine - score(smaller), p_value, smaller, wins(table) * (1 - p_value), support)


def is_equal(loss: Array) -> bool:
    """Whether the paired loss of an alternative is within two standard errors of nothing."""
    spread = float(np.std(loss, ddof=1)) * np.sqrt(len(loss))
    return bool(loss.sum() < max(ALTERNATIVE_SE * spread, 1.0))


def wins(table: Array, draws: int = 400) -> float:
    """Share of bootstrap samples of recordings in which the first row of (models, recordings) has the largest sum."""
    rng = np.random.default_rng(0)
    picks = rng.integers(0, table.shape[1], size=(draws, table.shape[1]))
    return float(np.mean(table[:, picks].sum(axis=2).argmax(axis=0) == 0))
