"""How often is the criticism right? Secrets hidden by the truth generator of the tests, drawn by seed, and counted.

    python benchmarks/criticism.py --clean 40 --each 2 --pairs 10 --unknown 10 --first-seed 10000

Prints counts with Clopper-Pearson 95 % intervals, beside naive baselines on the same sessions. The seeds of the tests
(500 to 800) are never used here.
"""

import argparse
import time
from collections import defaultdict
from collections.abc import Callable, Iterable

import numpy as np
from scipy.stats import beta

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.evidence import Tangents, amplitudes_of, information, tangents
from rig.diagnosis.fit import bold_view
from rig.diagnosis.indentation import Indentation
from rig.diagnosis.observations import observe
from rig.diagnosis.run import diagnose
from rig.diagnosis.search import testable
from tests.hidden.draw import KNOWN, UNKNOWN, Secret, draw_secret, recorded, session_of

STLSQ_SHARE = 0.05


def interval(hits: int, count: int) -> str:
    """``hits/count = share (Clopper-Pearson 95 % interval)``."""
    if count == 0:
        return "none run"
    low = float(beta.ppf(0.025, hits, count - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, count - hits)) if hits < count else 1.0
    return f"{hits}/{count} = {hits / count:.3f} ({low:.3f} to {high:.3f})"


def iid_bic(t: Tangents, samples: int) -> set[str]:
    """Forward selection by in-sample BIC with white noise, one direction at a time."""
    chosen: set[str] = set()
    for direction in t.directions:
        _, left = information(t, direction)
        amplitude = amplitudes_of(t, direction)
        saved = float(amplitude @ left @ amplitude)
        if saved > len(direction.columns) * np.log(samples):
            chosen.add(direction.effect.name)
    return chosen


def stlsq(t: Tangents) -> set[str]:
    """Sequentially thresholded least squares on the library's columns, as SINDy does, on normalised columns."""
    hessian, gradient = t.hessian.sum(axis=0), t.gradient.sum(axis=0)
    norm = np.sqrt(np.diag(hessian)) + 1e-12
    hessian, gradient = hessian / np.outer(norm, norm), gradient / norm
    active = np.ones(len(norm), bool)
    for _ in range(10):
        solution = np.zeros(len(norm))
        index = np.flatnonzero(active)
        solution[index] = np.linalg.lstsq(hessian[np.ix_(index, index)], gradient[index], rcond=1e-8)[0]
        active = (np.abs(solution) > STLSQ_SHARE * np.abs(solution).max()) | (np.arange(len(norm)) < t.base)
    return {d.effect.name for d in t.directions if any(active[c] for c in d.columns)}


def look_up(t: Tangents) -> set[str]:
    """The one effect whose column looks most like the residual."""
    gradient, hessian = t.gradient.sum(axis=0), t.hessian.sum(axis=0)
    match = [
        max(abs(gradient[c]) / np.sqrt(hessian[c, c] + 1e-300) for c in direction.columns) for direction in t.directions
    ]
    return {t.directions[int(np.argmax(match))].effect.name}


def baselines(result: Diagnosis, problem: Indentation) -> dict[str, set[str]]:
    """What naive methods name on the same session: white noise, no scatter beyond the usual, in-sample."""
    if result.search is None:
        return {}
    view = bold_view(result.search.before)
    t = tangents(view, testable(problem))
    return {"residual look-up": look_up(t), "in-sample BIC": iid_bic(t, problem.data.drive.size), "STLSQ": stlsq(t)}


def one(seed: int, secrets: Iterable[Secret]) -> tuple[Diagnosis, dict[str, set[str]]]:
    """Diagnosis and baselines of a session with these secrets."""
    causes = {name: numbers for secret in secrets for name, numbers in secret.causes.items()}
    bench, strokes = recorded(seed, Secret("all", causes, {}))
    data = observe(session_of(bench, strokes, stated="contact_offset" in causes))
    result = diagnose(data)
    return result, baselines(result, Indentation(data))


def named(result: Diagnosis) -> set[str]:
    """Everything in any answer set."""
    return {effect for finding in result.findings for effect in finding.effects}


def f1(found: set[str], truth: set[str]) -> float:
    """Harmonic mean of precision and recall."""
    return 2 * len(found & truth) / max(len(found) + len(truth), 1)


class Counts:
    """Hits and trials by question."""

    def __init__(self) -> None:
        self._hits: dict[str, list[bool]] = defaultdict(list)
        self._values: dict[str, list[float]] = defaultdict(list)

    def ask(self, question: str, answer: bool) -> None:
        """Counts one answer."""
        self._hits[question].append(bool(answer))

    def note(self, quantity: str, value: float) -> None:
        """Keeps a number whose mean is reported."""
        self._values[quantity].append(value)

    def show(self, out: Callable[[str], None]) -> None:
        """The table."""
        for question, answers in self._hits.items():
            out(f"{question:58s} {interval(sum(answers), len(answers))}")
        for quantity, values in self._values.items():
            out(f"{quantity:58s} {np.mean(values):.3f} over {len(values)}")


def clean(counts: Counts, seeds: Iterable[int]) -> None:
    """Sessions with nothing hidden."""
    for seed in seeds:
        result, naive = one(seed, ())
        counts.ask("clean: something named", bool(result.findings))
        counts.ask("clean: anything but adequate", result.verdict != "adequate")
        for method, found in naive.items():
            counts.ask(f"clean: something named by {method}", bool(found))


def single(counts: Counts, seeds: Iterable[int], verbose: bool) -> None:
    """Sessions with one secret of the library."""
    for seed in seeds:
        name = KNOWN[seed % len(KNOWN)]
        secret = draw_secret(np.random.default_rng([seed, 5]), name)
        result, naive = one(seed, (secret,))
        sets = [finding.effects for finding in result.findings]
        counts.ask("one hidden: something named", bool(sets))
        if sets:
            counts.ask("one hidden: truth in an answer set, if named", name in named(result))
            counts.ask("one hidden: first name right, if named", sets[0][0] == name)
            counts.ask("one hidden: exactly the truth named, nothing else", len(sets) == 1 and name in sets[0])
            counts.ask("one hidden: certain single names right", sets[0] == (name,)) if len(sets[0]) == 1 else None
        right = [finding for finding in result.findings if finding.effects[0] == name]
        for parameter, truth in secret.expected.items():
            for finding in right:
                found = finding.parameters[parameter]
                counts.ask("parameter inside its 95 % interval", found.low <= truth <= found.high)
                counts.note("parameter: relative error", abs(found.value - truth) / abs(truth))
        for method, found_names in naive.items():
            counts.note(f"one hidden: F1 of {method}", f1(found_names, {name}))
        counts.note("one hidden: F1", f1({s[0] for s in sets}, {name}))
        if verbose and (len(sets) != 1 or name not in sets[0]):
            print(
                f"  seed {seed} {name} {dict(secret.causes)}: {result.verdict} {sets} {result.depends_on}", flush=True
            )


def pairs(counts: Counts, seeds: Iterable[int], verbose: bool) -> None:
    """Sessions with two secrets of the library."""
    for seed in seeds:
        rng = np.random.default_rng([seed, 9])
        names = [str(name) for name in rng.choice(KNOWN, 2, replace=False)]
        result, naive = one(seed, [draw_secret(rng, name) for name in names])
        first = {finding.effects[0] for finding in result.findings}
        counts.ask("two hidden: exactly the pair", first == set(names))
        counts.note("two hidden: F1", f1(first, set(names)))
        for method, found in naive.items():
            counts.note(f"two hidden: F1 of {method}", f1(found, set(names)))
        if verbose and first != set(names):
            print(f"  seed {seed} {names}: {result.verdict} {sorted(first)} {result.depends_on}", flush=True)


def unknown(counts: Counts, seeds: Iterable[int], verbose: bool) -> None:
    """Sessions with something the library does not hold."""
    for seed in seeds:
        name = list(UNKNOWN)[seed % len(UNKNOWN)]
        result, _ = one(seed, (draw_secret(np.random.default_rng([seed, 5]), name),))
        flagged = result.verdict == "unexplained"
        counts.ask("unknown: flagged as unexplained", flagged)
        counts.ask("unknown: with the right variable", flagged and bool(set(result.depends_on) & set(UNKNOWN[name])))
        counts.ask("unknown: named without warning", result.verdict == "explained")
        if verbose and not flagged:
            print(f"  seed {seed} {name}: {result.verdict} {sorted(named(result))}", flush=True)


def main() -> None:
    """Runs what was asked for and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, count in (("clean", 40), ("each", 2), ("pairs", 10), ("unknown", 9), ("first-seed", 10_000)):
        parser.add_argument(f"--{name}", type=int, default=count)
    parser.add_argument("--verbose", action="store_true", help="prints every session that was not answered as wanted")
    asked = parser.parse_args()
    counts, start, first = Counts(), time.monotonic(), asked.first_seed
    clean(counts, range(first, first + asked.clean))
    single(counts, range(first, first + asked.each * len(KNOWN)), asked.verbose)
    pairs(counts, range(first, first + asked.pairs), asked.verbose)
    unknown(counts, range(first, first + asked.unknown), asked.verbose)
    counts.show(print)
    print(f"{time.monotonic() - start:.0f} s")


if __name__ == "__main__":
    main()
