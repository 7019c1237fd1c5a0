"""From what is left to a verdict: the error against what could be reached, against noise, and between repeats."""

from collections.abc import Sequence

import numpy as np

from rig.diagnosis.estimates import ErrorBudget, NamedCause, Verdict
from rig.diagnosis.fit import Fit
from rig.diagnosis.lack_of_fit import LEVEL, LackOfFit, find_better_trends, telling_variables, unexplained_variables
from rig.diagnosis.search import Search, shared_variables

# Noise in the air was met to 2 to 7 % by right models of 31 sessions of another program, and 10 % is 21 % of power.
MOST_OVER_FLOOR = 1.10
# Noise of a pressed tip is more than in the air, where no motor holds a load; of power it is half as much again.
MOST_OVER_NOISE = 1.25
# A quarter of the power that repeats differ by is an error of half of it; right models came to 0.16 at most.
MOST_SHARED = 0.25
# White: a residual of 0.7 mN in the dither of a quiet bench comes to less, and nobody would act on it.
LEAST_LEFT_N = 0.0003

# What tells causes apart that act through one variable alone.
ANOTHER = {"depth": "another tip, thickness, site or angle"}


def verdict_of(search: Search, after: LackOfFit, budget: ErrorBudget | None) -> tuple[Verdict, tuple[str, ...]]:
    """What can be said of the simulation, and what a residual depends on."""
    depends = left_variables(search, after)
    if budget is not None and reference_N(budget) is None:
        return "not judged", depends
    if depends:
        return "unexplained", depends
    if budget is not None and shortfalls(budget):
        return "unexplained", telling_variables(after) if after.p_value <= LEVEL else ()
    return ("explained" if search.named else "adequate"), ()


def reference_N(budget: ErrorBudget) -> float | None:
    """What is left by chance: noise where it was seen, else what repeats differ by; None where there is neither."""
    return budget.repeatability_N if budget.noise_N is None else budget.noise_N


def shortfalls(budget: ErrorBudget) -> list[str]:
    """What keeps a model from being called right, a clause each."""
    found, left_N, chance_N, shared = [], budget.extended_N, reference_N(budget), budget.shared_by_repeats
    if left_N > MOST_OVER_FLOOR * budget.floor_N:
        found.append(f"{budget.floor_N:.2g} N could be reached (at most {MOST_OVER_FLOOR:g} times that)")
    if shared is not None and shared.high > MOST_SHARED:
        found.append(f"repeats share up to {shared.high:.2g} times the power they differ by (at most {MOST_SHARED:g})")
    if chance_N is not None and left_N > MOST_OVER_NOISE * chance_N:
        by = "the noise" if budget.noise_N is not None else "what repeats differ by"
        found.append(f"it is {left_N / chance_N:.3g} times {by} (at most {MOST_OVER_NOISE:g})")
    return found


def left_sentence(budget: ErrorBudget) -> str:
    """What is left, of which what is noise, and what differs between repeats."""
    if budget.noise_N is not None and budget.extended_N <= budget.noise_N and not shortfalls(budget):
        return f"what is left is {budget.extended_N:.2g} N, no more than the noise ({budget.noise_N:.2g} N)"
    parts = [] if budget.noise_N is None else [f"{budget.noise_N:.2g} N is noise"]
    if budget.repeatability_N is not None:
        differs_N = np.sqrt(max(budget.repeatability_N**2 - (budget.noise_N or 0.0) ** 2, 0.0))
        parts.append(f"{differs_N:.2g} N differs between repeats")
    return f"what is left is {budget.extended_N:.2g} N{', of which ' * bool(parts)}{' and '.join(parts)}"


def left_variables(search: Search, after: LackOfFit) -> tuple[str, ...]:
    """Variables the residual still depends on, or recordings do; none where nothing that matters is left."""
    named = sum(found.nats for found in search.named)
    depends = unexplained_variables(after, named)
    if depends != after.between and left_N(search.after, after) < LEAST_LEFT_N:
        depends = ()
    if not depends:
        plainer = [find_better_trends(found.effect, search.after, found.without) for found in search.named]
        depends = tuple(dict.fromkeys(name for names in plainer for name in names))
    if not depends:
        depends = shared_variables([found.effect for found in search.named])
    return depends


def left_N(fit: Fit, found: LackOfFit) -> float:
    """The residual along its most telling variable as a white force [N]; infinite for what is no force."""
    share = max(found.shares[found.ranked[0]], 0.0)
    return float(np.sqrt(share)) * fit.whitener.noise.colours[0].sd if fit.problem.channels[0].unit == "N" else np.inf


def summary(
    verdict: Verdict,
    findings: Sequence[NamedCause],
    depends_on: Sequence[str],
    simulation: str,
    budget: ErrorBudget | None,
) -> str:
    """One sentence for a person, and what is left."""
    causes = "; ".join(finding.statement + _or(finding) for finding in findings)
    left = "" if budget is None else f"; {left_sentence(budget)}"
    if verdict == "adequate":
        return f"The {simulation} simulation explains these recordings as far as they can be judged{left}."
    if verdict == "explained":
        return f"The {simulation} simulation is wrong because {causes}{left}."
    hint = f" Provisionally: {causes}." if causes else ""
    if verdict == "not judged":
        return f"Nothing could be judged: neither air nor a repeated motion tells error from noise{left}.{hint}"
    on = f"; it depends on {', '.join(depends_on)}" if depends_on else ""
    why = "" if budget is None else "".join(f", {clause}" for clause in shortfalls(budget))
    return f"A residual is left that no known cause explains{on}{left}{why}.{hint}"


def _or(finding: NamedCause) -> str:
    """The other names of a set, and what alone would tell them apart where nothing of this kind does."""
    if not finding.effects[1:]:
        return ""
    one = finding.shared_variable
    why = f": through the {one} alone all do the same, and {ANOTHER[one]} would tell" if one else ""
    return f" (or {', '.join(finding.effects[1:])}{why})"
