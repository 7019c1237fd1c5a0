"""Mutation testing: `python -m benchmarks.mutation [--sample 60 --seed N] [--only controller/safety/table.py ...]`.

Each mutant is the code with one change; it is killed if a test fails with it. Prints what survived and is not listed in
`survivors.toml`, and what is listed there but was killed or is no mutant any more. The last line is one JSON object.
Exits with 1 where less than nine tenths of a file's mutants (of a sample's) are killed, or where list and run do not
agree; a survivor that a sample meets and that is not listed is printed, and fails the whole run only.
"""

import argparse
import json
import os
import random
import shlex
import sys
import time
from collections.abc import Sequence
from pathlib import Path

# Before numpy is imported: a forked process has no threads but its own.
os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}

from benchmarks.mutation.mutants import Mutant
from benchmarks.mutation.run import Result, Subject, run
from benchmarks.mutation.survivors import listed, unlisted, untrue
from rig.errors import CheckFailed

LEAST_SHARE = 0.9
ROOT = Path(__file__).resolve().parents[2]
SURVIVORS = Path(__file__).with_name("survivors.toml")
MODULES = (
    "controller/safety/table.py",
    "controller/safety/checks.py",
    "controller/safety/first_touch.py",
    "controller/safety/inputs.py",
    "controller/safety/load.py",
    "controller/safety/lost_contact.py",
    "controller/safety/giving_way.py",
    "controller/safety/oscillation.py",
    "controller/safety/program_limits.py",
    "controller/devices/health.py",
    "controller/loop/bench_loop.py",
    "controller/loop/phase_lock.py",
    "controller/devices/takeover.py",
    "controller/devices/states.py",
    "controller/loop/commands.py",
    "controller/loop/state_machine.py",
    "controller/loop/steps.py",
    "controller/loop/touch.py",
    "controller/supervisor.py",
    "controller/loop/client.py",
    "controller/stop/word.py",
    "controller/stop/start.py",
    "controller/stop/keypad.py",
    "controller/stop/http.py",
    "controller/stop/client.py",
    "controller/stop/keyboard.py",
    "controller/stop/liveness.py",
    "controller/stop/server.py",
)
FOLDER = "tests/controller"
# Left out of the tests that are to notice: those of the compiled control law and of its design, of calibrations, of
# whole physics (a minute, and other tests run the same lines), and those that measure time, which trials share.
LEFT_OUT = (
    "commissioning", "experiments", "law", "simulated", "loop/test_registration.py", "loop/test_setpoint_and_grid.py",
    "safety/test_force_limit.py", "safety/test_failing_channel.py",
)  # fmt: skip
TIMED = (
    "loop/test_touch.py::test_a_portion_of_the_estimate_leaves_the_loop_its_cycle",
    "stop/test_word.py::test_a_look_without_a_request_costs_the_loop_less_than_two_microseconds",
)
TESTS = (
    FOLDER,
    *(f"--ignore={FOLDER}/{part}" for part in LEFT_OUT),
    *(f"--deselect={FOLDER}/{test}" for test in TIMED),
)


def main() -> int:
    """Runs what was asked for; the exit code."""
    asked = _arguments()
    subject = Subject(asked.root, tuple(asked.only) or MODULES, asked.tests or TESTS)
    chosen = _chosen(_again(subject.mutants, asked.again), asked.sample, asked.seed)
    began = time.monotonic()

    def tell(results: Sequence[Result]) -> None:
        print(
            f"{len(results)} of {len(chosen)}, {_killed(results)} killed, {time.monotonic() - began:.0f} s", flush=True
        )
        _write(asked.json, results)

    try:
        results = run(subject, chosen, asked.jobs, tell)
    except CheckFailed as error:
        print(error, file=sys.stderr)
        return 1
    _write(asked.json, results)
    reasons, modules = listed(asked.survivors), _counts(results)
    missing, wrong = unlisted(results, reasons), untrue(results, reasons, subject.mutants)
    made, killed = len(results), _killed(results)
    low = [] if asked.again else _low({"of the sample": [made, killed]} if asked.sample else modules)
    print(*missing, *wrong, *low, f"{made} mutants in {time.monotonic() - began:.0f} s", sep="\n")
    print(json.dumps({"mutants": made, "killed": killed, "share": round(killed / max(made, 1), 4), "modules": modules}))
    # A sample says whether the tests notice; whether the list is complete, only a whole run.
    return 1 if wrong or low or (missing and not asked.sample) else 0


def _low(counts: dict[str, list[int]]) -> list[str]:
    return [
        f"{name}: {killed} of {made} mutants are killed, fewer than {LEAST_SHARE:.0%}"
        for name, (made, killed) in counts.items()
        if killed < LEAST_SHARE * made
    ]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutation", description=__doc__)
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="only N mutants, drawn by the seed")
    parser.add_argument("--seed", type=int, default=None, help="of the sample; without it one is drawn and printed")
    parser.add_argument("--only", nargs="*", default=(), metavar="FILE", help="mutate only these files")
    parser.add_argument("--root", type=Path, default=ROOT, help="of the project, for other files and tests than ours")
    parser.add_argument("--tests", type=shlex.split, default=(), metavar="ARGUMENTS", help="pytest's arguments")
    parser.add_argument("--survivors", type=Path, default=SURVIVORS, metavar="FILE", help="the list to agree with")
    # One more than cores: a trial waits for sockets and processes, and one that hangs for its whole time.
    parser.add_argument("--jobs", type=int, default=(os.cpu_count() or 1) + 1, help="mutants tried at a time")
    parser.add_argument("--again", type=Path, default=None, metavar="FILE", help="only what survived in that --json")
    parser.add_argument("--json", type=Path, default=None, metavar="FILE", help="write every verdict there")
    return parser.parse_args()


def _again(mutants: Sequence[Mutant], verdicts: Path | None) -> Sequence[Mutant]:
    if verdicts is None:
        return mutants
    survived = {(row["path"], row["mutant"]) for row in json.loads(verdicts.read_text()) if not row["killed"]}
    return [mutant for mutant in mutants if (mutant.path, mutant.name) in survived]


def _chosen(mutants: Sequence[Mutant], sample: int, seed: int | None) -> list[Mutant]:
    if not sample:
        return list(mutants)
    seed = random.SystemRandom().randrange(1 << 32) if seed is None else seed
    print(f"a sample of {sample} of {len(mutants)} mutants, --seed {seed}", flush=True)
    return random.Random(seed).sample(list(mutants), min(sample, len(mutants)))


def _killed(results: Sequence[Result]) -> int:
    return sum(result.verdict.killed for result in results)


def _counts(results: Sequence[Result]) -> dict[str, list[int]]:
    counts: dict[str, list[int]] = {}
    for result in sorted(results, key=lambda result: result.mutant.path):
        both = counts.setdefault(result.mutant.path, [0, 0])
        both[0] += 1
        both[1] += result.verdict.killed
    return counts


def _write(path: Path | None, results: Sequence[Result]) -> None:
    if path:
        rows = [
            {"path": result.mutant.path, "line": result.mutant.place.line, "mutant": result.mutant.name,
             "killed": result.verdict.killed, "by": result.verdict.by, "seconds": round(result.verdict.seconds, 2)}
            for result in results
        ]  # fmt: skip
        path.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    sys.exit(main())
