"""From evidence to words and numbers: verdict, findings with intervals and gains, what could have been seen."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rig.diagnosis.estimates import (
    ErrorGain,
    Estimate,
    NamedCause,
    NextExperiment,
    SimulationError,
    SmallestSize,
    Unexplained,
    Verdict,
)
from rig.diagnosis.evidence import Tangents, held_out_square_error, information, is_alias, jackknife
from rig.diagnosis.fit import Fit, least_squares
from rig.diagnosis.lack_of_fit import LackOfFit, find_better_trends, unexplained_variables
from rig.diagnosis.noise import Array
from rig.diagnosis.problem import Effect, InverseProblem, Par
from rig.diagnosis.search import Named, Search, shared_variables, testable
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
# A model whose noise and scatter are this large against the signal explains nothing, however white its residual.
MOST_CHANCE = 0.25
# White: a residual of 0.7 mN in the dither of a quiet bench comes to less, and nobody would act on it.
LEAST_LEFT_N = 0.0003


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
    simulated: tuple[SimulationError, ...] = ()

    @property
    def unexplained(self) -> Unexplained | None:
        """What is left, where no known cause explains it."""
        return Unexplained(self.depends_on, self.lack_of_fit_p) if self.verdict == "unexplained" else None


def intervals(fit: Fit, wanted: Sequence[Par]) -> dict[str, Estimate]:
    """95 % intervals with Student's t on recordings, the wider of curvature and jackknife; a pair becomes its size.

    To amplitudes 1.5 % is added, in quadrature: what the operators themselves are good for.
    """
    wide = student_reach(fit.problem.recordings - 1)
    covariances = fit.covariance, jackknife(fit)
    place = {par.name: k for k, par in enumerate(fit.free)}
    found: dict[str, Estimate] = {}
    for par in wanted:
        value = fit.values[par.name]
        if par.name not in place:
            found[par.name] = Estimate(value, par.low, par.high)
        elif par.name.endswith("_sin_mm"):
            found[par.name.replace("_sin_mm", "_mm")] = _amplitude(fit, par.name, place, wide, covariances)
        elif not par.name.endswith("_cos_mm"):
            k = place[par.name]
            half = wide * max(float(np.sqrt(c[k, k])) for c in covariances)
            half = min(half, LARGEST_LOG) if par.log else half
            half = float(np.hypot(half, OPERATOR_SHARE * abs(value - par.null))) if par.least else half
            low, high = (value / np.exp(half), value * np.exp(half)) if par.log else (value - half, value + half)
            found[par.name] = Estimate(value, max(low, par.low), min(high, par.high), stopped(par, value))
    return found


def stopped(par: Par, value: float) -> bool:
    """Whether a size has gone all the way from its null to a bound."""
    bound = par.high if value > par.null else par.low
    return bool(par.least and abs(value - par.null) >= NEAR_BOUND * abs(bound - par.null))


def _amplitude(fit: Fit, sine: str, place: Mapping[str, int], wide: float, covariances: Sequence[Array]) -> Estimate:
    pair = np.array([fit.values[sine], fit.values[sine.replace("_sin_", "_cos_")]])
    index = [place[sine], place[sine.replace("_sin_", "_cos_")]]
    size = float(np.hypot(*pair))
    variance = max(float(pair @ c[np.ix_(index, index)] @ pair) for c in covariances) / max(size**2, 1e-300)
    half = float(np.hypot(wide * np.sqrt(variance), OPERATOR_SHARE * size))
    return Estimate(size, max(size - half, 0.0), size + half)


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


def answer(named: Named, after: Fit, provisional: bool) -> NamedCause:
    """One finding of the final model."""
    effect = named.effect
    return NamedCause(
        (effect.name, *named.alternatives),
        sentence(effect, after.values),
        named.share * (PROVISIONAL_SHARE if provisional else 1.0),
        intervals(after, effect.pars),
        gain_of(named.without, after),
        named.nats,
        named.p_value,
        effect.repair,
        provisional,
    )


def smallest_visible(t: Tangents, threshold: float) -> dict[str, SmallestSize]:
    """Amplitude that would have been named with 80 % probability, by effect; the median over its shapes."""
    needed = np.sqrt(2 * (threshold + LEAVING_OUT_NATS)) + POWER_SD
    sizes: dict[str, list[float]] = {}
    for direction in t.directions:
        if is_alias(t, direction):
            continue
        _, left = information(t, direction)
        weakest = float(np.linalg.eigvalsh(left).min())
        sizes.setdefault(direction.effect.name, []).append(needed / np.sqrt(max(weakest, 1e-300)))
    effects = {direction.effect.name: direction.effect for direction in t.directions}
    result = {}
    for name, found in sizes.items():
        par = effects[name].amplitudes[0]
        result[name] = SmallestSize(max(float(np.median(found)), par.least), par.unit)
    return result


def limits(problem: InverseProblem, search: Search) -> tuple[dict[str, SmallestSize], dict[str, str]]:
    """What could have been seen, and what not and why."""
    level = max(float(np.quantile(maxima, 0.95)) for maxima in search.maxima if maxima.size)
    visible = smallest_visible(search.tangents, max(level, 0.0))
    reasons = invisible(problem, {*visible, *search.after.names})
    for effect in testable(problem):
        par = effect.amplitudes[0]
        if effect.name in visible and visible[effect.name].minimum > par.high - par.null:
            size = visible.pop(effect.name)
            reasons[effect.name] = f"only {size.minimum:.2g} {size.unit} or more would have shown in this experiment"
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
    return lacking | {effect.name: imitated for effect in testable(problem) if effect.name not in seen}


def verdict_of(search: Search, after: LackOfFit) -> tuple[Verdict, tuple[str, ...]]:
    """Adequate, explained or unexplained, and what a residual depends on."""
    named = sum(found.nats for found in search.named)
    depends = unexplained_variables(after, named)
    if depends != after.between and left_N(search.after, after) < LEAST_LEFT_N:
        depends = ()
    if not depends:
        plainer = [find_better_trends(found.effect, search.after, found.without) for found in search.named]
        depends = tuple(dict.fromkeys(name for names in plainer for name in names))
    if not depends:
        depends = shared_variables([found.effect for found in search.named])
    if not depends and left_to_chance(search.after) > MOST_CHANCE:
        depends = ("recording",)
    if depends:
        return "unexplained", depends
    return ("explained" if search.named else "adequate"), ()


def left_N(fit: Fit, found: LackOfFit) -> float:
    """The residual along its most telling variable as a white force [N]; infinite for what is no force."""
    share = max(found.shares[found.ranked[0]], 0.0)
    return float(np.sqrt(share)) * fit.whitener.noise.colours[0].sd if fit.problem.channels[0].unit == "N" else np.inf


def left_to_chance(fit: Fit) -> float:
    """Error on recordings left out as a share of the signal's own spread."""
    spread = float(np.std(fit.problem.channels[0].observed))
    return float(np.sqrt(held_out_square_error(least_squares(fit)).mean())) / max(spread, 1e-300)


def summary(verdict: Verdict, findings: Sequence[NamedCause], depends_on: Sequence[str], simulation: str) -> str:
    """One sentence for a person."""
    if verdict == "adequate":
        return f"The {simulation} simulation explains these recordings to within their noise; nothing else is needed."
    causes = "; ".join(
        finding.statement + (f" (or {', '.join(finding.effects[1:])})" if finding.effects[1:] else "")
        for finding in findings
    )
    if verdict == "explained":
        return f"The {simulation} simulation is wrong because {causes}."
    hint = f" Provisionally: {causes}." if causes else ""
    return f"A residual is left that no known cause explains; it depends on {', '.join(depends_on)}.{hint}"
