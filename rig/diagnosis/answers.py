"""From evidence to words and numbers: findings with intervals and gains, what could have been seen."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rig.diagnosis.estimates import (
    AxisPrediction,
    ErrorBudget,
    ErrorGain,
    Estimate,
    NamedCause,
    NextExperiment,
    SimulationError,
    SmallestSize,
    Unexplained,
    Verdict,
)
from rig.diagnosis.evidence import (
    PARTS,
    Tangents,
    held_out_square_error,
    information,
    is_alias,
    jackknife,
    jackknife_along,
)
from rig.diagnosis.fit import Fit, least_squares
from rig.diagnosis.lack_of_fit import LackOfFit, variables
from rig.diagnosis.noise import Array
from rig.diagnosis.problem import Effect, InverseProblem, Par
from rig.diagnosis.search import Named, Search, chance_level, testable
from rig.diagnosis.verdict import shortfalls
from rig.tissue.intervals import student_reach
from rig.trials.findings import Finding

POWER_SD = 0.84  # 80 % power
LEAVING_OUT_NATS = 1.0
# Operators on a grid of 4 ms are not exact: development seeds gave sizes up to 1 % off within far tighter intervals.
OPERATOR_SHARE = 0.015
# On development seeds none of the names beside an unexplained residual was right; some will be.
PROVISIONAL_SHARE = 0.2
DRAWS = 1000  # 25 beyond each end of a 95 % interval
NEAR_BOUND = 0.99  # sizes are no surer than 1.5 % (OPERATOR_SHARE)
LARGEST_LOG = 20.0  # a factor of e^20 is beyond the bounds of every parameter, and is still a number
# Why no size is stated from which a cause would have been found, by the verdict.
HIDING = {
    "unexplained": "not judged: something is left that no known cause explains, which may hide it",
    "not judged": "not judged: nothing tells how much is left by chance, and what is left may hide it",
}


@dataclass(frozen=True)
class Diagnosis:
    """Everything `rig diagnose` says."""

    session: str
    simulation: str
    recordings: int
    verdict: Verdict
    statement: str
    findings: tuple[NamedCause, ...]
    depends_on: tuple[str, ...]
    lack_of_fit_p: float | None
    detectable: Mapping[str, SmallestSize]
    not_testable: Mapping[str, str]
    next_experiment: NextExperiment | None
    quality: tuple[Finding, ...]
    base: Mapping[str, Estimate] = field(default_factory=dict)
    search: Search | None = None
    before: LackOfFit | None = None
    after: LackOfFit | None = None
    budget: ErrorBudget | None = None
    simulated: tuple[SimulationError, ...] = ()
    axis: AxisPrediction | None = None

    @property
    def unexplained(self) -> Unexplained | None:
        """What is left, where no known cause explains it."""
        return Unexplained(self.depends_on, self.lack_of_fit_p) if self.verdict == "unexplained" else None


def intervals(fit: Fit, wanted: Sequence[Par], sources: Sequence[Array] | None = None) -> dict[str, Estimate]:
    """95 % intervals of what ``error_sources`` says of the fit; a pair becomes its size.

    To amplitudes 1.5 % is added, in quadrature: what the operators themselves are good for.
    """
    covariances = error_sources(fit) if sources is None else sources
    place = {par.name: k for k, par in enumerate(fit.free)}
    found: dict[str, Estimate] = {}
    for par in wanted:
        value = fit.values[par.name]
        if par.name not in place:
            found[par.name] = Estimate(value, par.low, par.high, unit=par.unit)
        elif "_sin" in par.name:
            found[par.name.replace("_sin", "")] = _amplitude(fit, par.name, place, covariances)
        elif "_cos" not in par.name:
            half = _half(covariances, np.eye(len(fit.free))[place[par.name]])
            half = min(half, LARGEST_LOG) if par.log else half
            half = float(np.hypot(half, OPERATOR_SHARE * abs(value - par.null))) if par.least else half
            low, high = (value / np.exp(half), value * np.exp(half)) if par.log else (value - half, value + half)
            found[par.name] = Estimate(value, max(low, par.low), min(high, par.high), stopped(par, value), par.unit)
    return found


def stopped(par: Par, value: float) -> bool:
    """Whether a size has gone all the way from its null to a bound."""
    bound = par.high if value > par.null else par.low
    return bool(par.least and abs(value - par.null) >= NEAR_BOUND * abs(bound - par.null))


def error_sources(fit: Fit, is_left: bool = False) -> list[Array]:
    """Covariances of the parameters, one set a source of error, each times the square of its reach; (kinds, p, p).

    Student's t on recordings, of curvature and jackknife; where something ``is_left`` that no cause explains, also what
    leaving out parts of the data does.
    """
    reach = student_reach(fit.problem.recordings - 1) ** 2
    sources = [reach * np.array([fit.covariance, jackknife(fit)])]
    if is_left:
        parts = [jackknife_along(fit, variable) for variable in variables(fit).values()]
        sources.append(student_reach(PARTS - 1) ** 2 * np.array(parts))
    return sources


def _half(covariances: Sequence[Array], direction: Array) -> float:
    """Half the interval along ``direction``: of each source the widest, in quadrature."""
    return float(np.sqrt(sum(float(np.max(direction @ source @ direction)) for source in covariances)))


def _amplitude(fit: Fit, sine: str, place: Mapping[str, int], covariances: Sequence[Array]) -> Estimate:
    cosine = sine.replace("_sin", "_cos")
    pair = np.array([fit.values[sine], fit.values[cosine]])
    size, direction = float(np.hypot(*pair)), np.zeros(len(fit.free))
    direction[[place[sine], place[cosine]]] = pair / max(size, 1e-150)
    half = float(np.hypot(_half(covariances, direction), OPERATOR_SHARE * size))
    return Estimate(size, max(size - half, 0.0), size + half, unit=fit.free[place[sine]].unit)


def gain_of(before: Fit, after: Fit) -> ErrorGain:
    """Held-out error of two models, each at its least-squares best, with a bootstrap over recordings."""
    old, new = (held_out_square_error(least_squares(model)) for model in (before, after))
    picks = np.random.default_rng(0).integers(0, len(old), size=(DRAWS, len(old)))
    reductions = 1 - np.sqrt(new[picks].mean(axis=1) / np.maximum(old[picks].mean(axis=1), 1e-300))
    low, high = np.percentile(reductions, [2.5, 97.5])
    rmse = float(np.sqrt(old.mean())), float(np.sqrt(new.mean()))
    return ErrorGain(*rmse, 1 - rmse[1] / max(rmse[0], 1e-300), float(low), float(high))


def sentence(effect: Effect, values: Mapping[str, float]) -> str:
    """The effect's statement with its numbers."""
    pair = [values[par.name] for par in effect.amplitudes]
    return effect.statement.format(**values, amplitude=float(np.hypot.reduce(pair)))


def answer(named: Named, after: Fit, provisional: bool, sources: Sequence[Array]) -> NamedCause:
    """One finding of the final model."""
    effect = named.effect
    return NamedCause(
        tuple(dict.fromkeys((effect.name, *named.alternatives, *named.family))), sentence(effect, after.values),
        named.share * (PROVISIONAL_SHARE if provisional else 1.0), intervals(after, effect.pars, sources),
        gain_of(named.without, after), float(named.support.nats.sum()), named.p_value, effect.repair, provisional,
        named.support.standard_error_nats, "depth" if named.family else None,
    )  # fmt: skip


def smallest_visible(t: Tangents, threshold: float) -> dict[str, SmallestSize]:
    """Amplitude that would have been named with 80 % probability, by name: of its first law, the median over shapes."""
    needed = np.sqrt(2 * (threshold + LEAVING_OUT_NATS)) + POWER_SD
    first, sizes = dict[str, Effect](), dict[str, list[float]]()
    for direction in t.directions:
        effect = first.setdefault(direction.effect.name, direction.effect)
        if direction.effect is not effect or is_alias(t, direction):
            continue
        _, left = information(t, direction)
        weakest = float(np.linalg.eigvalsh(left).min())
        sizes.setdefault(effect.name, []).append(needed / np.sqrt(max(weakest, 1e-300)))
    result = {}
    for name, found in sizes.items():
        par = first[name].amplitudes[0]
        result[name] = SmallestSize(max(float(np.median(found)), par.least), par.unit)
    return result


def without_sizes(found: Diagnosis) -> Diagnosis:
    """The diagnosis, with a reason for each size from which a cause would have been found where more may be left."""
    reasons = dict.fromkeys(found.detectable, HIDING.get(found.verdict, ""))
    if found.verdict not in HIDING:
        return found
    return replace(found, detectable={}, not_testable={**found.not_testable, **reasons})


def limits(
    problem: InverseProblem, search: Search, budget: ErrorBudget | None
) -> tuple[dict[str, SmallestSize], dict[str, str]]:
    """What could have been seen, and what not and why; no size where the model itself falls short of what is right."""
    level = chance_level(search.maxima)
    visible = smallest_visible(search.tangents, max(level, 0.0))
    reasons = invisible(problem, {*visible, *search.after.names})
    for effect in testable(problem):
        par = effect.amplitudes[0]
        if effect.name in visible and visible[effect.name].minimum > par.high - par.null:
            size = visible.pop(effect.name)
            reasons[effect.name] = f"only {size.minimum:.2g} {size.unit} or more would have shown in this experiment"
    missed = shortfalls(budget) if budget else []
    if missed:
        return {}, dict.fromkeys(visible, f"not judged: what is left may hide it; {missed[0]}") | reasons
    return visible, reasons


def invisible(problem: InverseProblem, seen: Collection[str]) -> dict[str, str]:
    """Why the causes that are not among ``seen`` could not be: what the data lack, or the simulation imitates them."""
    lacking = {
        effect.name: problem.offers[need]
        for effect in problem.effects
        for need in sorted(effect.needs)
        if need in problem.offers
    }
    imitated = "the simulation's own parameters imitate it completely in this experiment"
    unseen = [effect for effect in testable(problem) if effect.name not in seen]
    return lacking | {e.name: f"it is looked for beside {e.beside} only" if e.beside else imitated for e in unseen}
