"""How often is the criticism right? Secrets hidden by the truth generator of the tests, drawn by seed, and counted.

    python benchmarks/criticism.py --kinds clean --count 200 --seed 10000 --out clean.json
    python benchmarks/criticism.py --kinds single pairs unknown --count 60 --seed 10000 --jobs 2 --out rest.json
    python benchmarks/criticism.py --table clean.json rest.json

A file holds one record a session and grows with every session: the same command again goes on where it was stopped.
The table gives counts with Clopper-Pearson 95 % intervals beside naive methods on the same sessions. Seeds below 10000
are for development.
"""

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import beta

from benchmarks.criticism_naive import naive
from benchmarks.hidden.draw import KNOWN, UNKNOWN, Secret, draw_secret, recorded, session_of
from rig.diagnosis.observations import observe
from rig.diagnosis.run import diagnose

KINDS = ("clean", "single", "pairs", "unknown")
BINS = 5
Record = dict[str, Any]


def secrets_of(kind: str, seed: int) -> list[Secret]:
    """What a session of this kind hides."""
    rng = np.random.default_rng([seed, 9 if kind == "pairs" else 5])
    if kind == "clean":
        return []
    if kind == "pairs":
        return [draw_secret(rng, str(name)) for name in rng.choice(KNOWN, 2, replace=False)]
    names = KNOWN if kind == "single" else tuple(UNKNOWN)
    return [draw_secret(rng, names[seed % len(names)])]


def record(kind: str, seed: int) -> Record:
    """One session made, diagnosed and written down."""
    secrets = secrets_of(kind, seed)
    causes = {name: numbers for secret in secrets for name, numbers in secret.causes.items()}
    bench, cycles = recorded(seed, Secret("all", causes, {}))
    data = observe(session_of(bench, cycles, stated="contact_offset" in causes))
    begin = time.process_time()
    result = diagnose(data)
    seconds = time.process_time() - begin
    return {
        "kind": kind, "seed": seed, "truth": [secret.name for secret in secrets],
        "causes": {name: dict(numbers) for name, numbers in causes.items()},
        "expected": {secret.name: dict(secret.expected) for secret in secrets},
        "verdict": result.verdict, "depends_on": list(result.depends_on),
        "left": None if result.after is None else asdict(result.after),
        "findings": [asdict(finding) for finding in result.findings],
        "naive": naive(result.search), "cpu_s": round(seconds, 1),
    }  # fmt: skip


def read(path: Path) -> list[Record]:
    """Records written before; none where there is no file."""
    return json.loads(path.read_text()) if path.exists() else []


def write(path: Path, records: Sequence[Record]) -> None:
    """All records, in place of the file that was there, never half."""
    path.parent.mkdir(parents=True, exist_ok=True)
    whole = path.with_suffix(".part")
    whole.write_text(json.dumps(records, indent=0))
    whole.replace(path)


def collect(kinds: Sequence[str], seeds: Iterable[int], jobs: int, out: Path) -> None:
    """Every session that is not in the file yet."""
    records = read(out)
    done = {(one["kind"], one["seed"]) for one in records}
    wanted = [(kind, seed) for seed in seeds for kind in kinds if (kind, seed) not in done]
    with ProcessPoolExecutor(jobs) as pool:
        running = {pool.submit(record, kind, seed): (kind, seed) for kind, seed in wanted}
        for future in as_completed(running):
            records.append(crashed(*running[future]) if future.exception() else future.result())
            write(out, records)
            print(line(records[-1]), flush=True)


def crashed(kind: str, seed: int) -> Record:
    """What stands in the file for a session whose diagnosis raised: no answer is a wrong answer."""
    return {
        "kind": kind, "seed": seed, "truth": [secret.name for secret in secrets_of(kind, seed)], "causes": {},
        "expected": {}, "verdict": "crashed", "depends_on": [], "left": None, "findings": [], "naive": {}, "cpu_s": 0.0,
    }  # fmt: skip


def line(one: Record) -> str:
    """One session in one line."""
    sets = " ".join("{" + ",".join(finding["effects"]) + "}" for finding in one["findings"])
    truth, left = " ".join(one["truth"]) or "nothing", ",".join(one["depends_on"])
    return f"{one['kind']} {one['seed']} hid {truth}: {one['verdict']} {sets} {left} ({one['cpu_s']} s)"


def interval(hits: int, count: int) -> str:
    """``hits/count = share (Clopper-Pearson 95 % interval)``."""
    low = float(beta.ppf(0.025, hits, count - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, count - hits)) if hits < count else 1.0
    return f"{hits}/{count} = {hits / count:.3f} ({low:.3f} to {high:.3f})"


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
            out(f"{quantity:58s} {np.mean(values):.3f} (median {np.median(values):.3f}) over {len(values)}")


def f1(found: Iterable[str], truth: Iterable[str]) -> float:
    """Harmonic mean of precision and recall."""
    found, truth = set(found), set(truth)
    return 2 * len(found & truth) / max(len(found) + len(truth), 1)


def first_names(one: Record) -> set[str]:
    """The best name of every answer set."""
    return {finding["effects"][0] for finding in one["findings"]}


def count_clean(counts: Counts, one: Record) -> None:
    """Nothing hidden: nothing may be named."""
    counts.ask("clean: something named", bool(one["findings"]))
    counts.ask("clean: anything but adequate", one["verdict"] != "adequate")
    for method, names in one["naive"].items():
        counts.ask(f"clean: something named by {method}", bool(names))


def count_single(counts: Counts, one: Record) -> None:
    """One cause hidden."""
    name, sets = one["truth"][0], [finding["effects"] for finding in one["findings"]]
    counts.ask("one hidden: something named", bool(sets))
    if sets:
        counts.ask("one hidden: truth in an answer set, if named", any(name in names for names in sets))
        counts.ask("one hidden: first name right, if named", sets[0][0] == name)
        counts.ask("one hidden: exactly the truth and nothing else", len(sets) == 1 and sets[0][0] == name)
    for names in (names for names in sets if len(names) == 1):
        counts.ask("one hidden: certain single names right", names == [name])
    counts.note("one hidden: F1", f1(first_names(one), [name]))
    for method, names in one["naive"].items():
        counts.note(f"one hidden: F1 of {method}", f1(names, [name]))


def count_pairs(counts: Counts, one: Record) -> None:
    """Two causes hidden."""
    first = first_names(one)
    counts.ask("two hidden: exactly the pair", first == set(one["truth"]))
    inside = {effect for finding in one["findings"] for effect in finding["effects"]}
    counts.ask("two hidden: both in the answer sets", set(one["truth"]) <= inside)
    counts.note("two hidden: F1", f1(first, one["truth"]))
    for method, names in one["naive"].items():
        counts.note(f"two hidden: F1 of {method}", f1(names, one["truth"]))


def count_unknown(counts: Counts, one: Record) -> None:
    """Something hidden that the library does not hold."""
    name, flagged = one["truth"][0], one["verdict"] == "unexplained"
    right = flagged and bool(set(one["depends_on"]) & set(UNKNOWN[name]))
    counts.ask("unknown: flagged as unexplained", flagged)
    counts.ask("unknown: flagged with the right variable", right)
    counts.ask("unknown: named without warning", one["verdict"] == "explained")
    counts.ask(f"unknown: {name} flagged with the right variable", right)


def count_intervals(counts: Counts, one: Record) -> None:
    """Parameters of what was rightly named, against the truth."""
    for finding in one["findings"]:
        for parameter, truth in one["expected"].get(finding["effects"][0], {}).items():
            found = finding["parameters"][parameter]
            counts.ask("parameter inside its 95 % interval", found["low"] <= truth <= found["high"])
            counts.note("parameter: relative error", abs(found["value"] - truth) / abs(truth))
            counts.note("parameter: half width over truth", (found["high"] - found["low"]) / 2 / abs(truth))


def named_by_truth(records: Iterable[Record]) -> tuple[np.ndarray, np.ndarray]:
    """Confidence of every finding and whether its first name is right, each (findings,)."""
    pairs = [
        (finding["confidence"], finding["effects"][0] in one["truth"]) for one in records for finding in one["findings"]
    ]
    return np.array([p for p, _ in pairs]), np.array([right for _, right in pairs], float)


def tempered(confidence: np.ndarray, temperature: float) -> np.ndarray:
    """Confidence with its log odds divided by ``temperature``."""
    odds = np.clip(confidence, 1e-3, 1 - 1e-3)
    return np.asarray(1 / (1 + ((1 - odds) / odds) ** (1 / temperature)))


def best_temperature(confidence: np.ndarray, right: np.ndarray) -> float:
    """The temperature with the largest likelihood of the outcomes."""

    def loss(log_temperature: float) -> float:
        p = tempered(confidence, float(np.exp(log_temperature)))
        return -float(np.sum(np.log(np.where(right > 0, p, 1 - p))))

    return float(np.exp(minimize_scalar(loss, bounds=(-2, 3), method="bounded").x))


def calibration_error(confidence: np.ndarray, right: np.ndarray) -> float:
    """Expected calibration error over equal bins of confidence."""
    bins = np.minimum((confidence * BINS).astype(int), BINS - 1)
    gaps = [abs(float(np.sum(confidence[bins == k] - right[bins == k]))) for k in range(BINS)]
    return sum(gaps) / len(confidence)


def show_confidence(records: Sequence[Record]) -> None:
    """Brier score and calibration error of the confidence as printed, and the temperature these data would choose."""
    confidence, right = named_by_truth(records)
    if len(confidence) == 0:
        return
    brier, chosen = float(np.mean((confidence - right) ** 2)), best_temperature(confidence, right)
    again = tempered(confidence, chosen)
    print(f"confidence of {len(right)} names: mean {confidence.mean():.3f}, right {right.mean():.3f}, "
          f"Brier {brier:.3f}, ECE {calibration_error(confidence, right):.3f}")  # fmt: skip
    print(f"temperature these names would choose: {chosen:.2f} (Brier {np.mean((again - right) ** 2):.3f}, "
          f"ECE {calibration_error(again, right):.3f})")  # fmt: skip


def table(records: Sequence[Record]) -> None:
    """Counts of all records."""
    counts, ask = Counts(), dict(zip(KINDS, (count_clean, count_single, count_pairs, count_unknown), strict=True))
    for one in sorted(records, key=lambda one: (KINDS.index(one["kind"]), one["seed"])):
        ask[one["kind"]](counts, one)
        count_intervals(counts, one)
    for kind in KINDS:
        seeds = [one["seed"] for one in records if one["kind"] == kind]
        if seeds:
            print(f"{kind}: {len(seeds)} sessions, seeds {min(seeds)} to {max(seeds)}")
    counts.show(print)
    show_confidence(records)
    print(f"CPU a session: median {np.median([one['cpu_s'] for one in records]):.0f} s, "
          f"longest {max(one['cpu_s'] for one in records):.0f} s")  # fmt: skip


def main() -> None:
    """Runs what was asked for, or prints the table of what was run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--count", type=int, default=4, help="sessions of each kind")
    parser.add_argument("--seed", type=int, default=10_000, help="first seed")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("criticism.json"), help="file that holds the records")
    parser.add_argument("--table", type=Path, nargs="+", help="prints the table of these files and runs nothing")
    asked = parser.parse_args()
    if not asked.table:
        collect(asked.kinds, range(asked.seed, asked.seed + asked.count), asked.jobs, asked.out)
    records = [one for path in asked.table or [asked.out] for one in read(path)]
    if records:
        table(records)


if __name__ == "__main__":
    main()
