"""Tries mutants, some at a time, each in a process of its own; first makes sure that the tests pass without any."""

import ast
import gc
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TextIO

import pytest

from benchmarks.mutation import inplace, trials
from benchmarks.mutation.inplace import Collected
from benchmarks.mutation.lines import RAN, Coverage, Observer, with_probes
from benchmarks.mutation.mutants import Mutant, enums_of, mutants_of, mutated
from benchmarks.mutation.trials import Trial, Verdict
from rig.errors import CheckFailed

POLL_S = 0.005
EVERY = 100
CONTROLS = 20


@dataclass(frozen=True)
class Subject:
    """What is mutated: files below ``root``, and pytest's arguments for the tests that are to notice."""

    root: Path
    paths: Sequence[str]
    tests: Sequence[str]

    @cached_property
    def enums(self) -> dict[str, list[str]]:
        """Enumerations of the packages that the mutated files are of, whichever of the files are tried."""
        packages = sorted({self.root / Path(path).parts[0] for path in self.paths})
        return enums_of(path for package in packages for path in sorted(package.rglob("*.py")))

    @cached_property
    def mutants(self) -> list[Mutant]:
        """All of them."""
        return [mutant for path in self.paths for mutant in mutants_of(self.root / path, path, self.enums)]


@dataclass(frozen=True)
class Result:
    """What became of one mutant."""

    mutant: Mutant
    verdict: Verdict


Begin = Callable[[Mutant], Trial | None]
Tell = Callable[[Sequence[Result]], None]


def run(subject: Subject, chosen: Sequence[Mutant], jobs: int, tell: Tell) -> list[Result]:
    """Tries ``chosen`` and tells what is known so far every hundred; CheckFailed where tests fail without a mutant.

    First those of functions, in place; then, imported anew, those that run at import or could not be put in place.
    """
    trials.FRESH.update(path.partition("/")[0] for path in subject.paths)
    os.chdir(subject.root)
    tests = _looked_at(subject)
    _check_unchanged(subject, tests)
    results = _in_place(subject, [mutant for mutant in chosen if not mutant.place.at_import], tests, jobs, tell)
    done = {result.mutant for result in results}
    left = [mutant for mutant in chosen if mutant not in done]
    list(_tried(left, jobs, lambda mutant: _begin_anew(subject, mutant, tests), results, tell))
    return results


def _tried(mutants: Sequence[Mutant], jobs: int, begin: Begin, results: list[Result], tell: Tell) -> Iterator[Result]:
    """Tries ``jobs`` at a time, but for mutants that ``begin`` has no trial for; ``results`` grows by what is found."""
    waiting, under_way = list(reversed(mutants)), dict[Mutant, Trial]()
    while waiting or under_way:
        while waiting and len(under_way) < jobs:
            mutant = waiting.pop()
            if trial := begin(mutant):
                under_way[mutant] = trial
        for mutant, trial in list(under_way.items()):
            if verdict := trial.poll():
                del under_way[mutant]
                results.append(Result(mutant, verdict))
                yield results[-1]
                if len(results) % EVERY == 0:
                    tell(results)
        time.sleep(POLL_S)


def _in_place(subject: Subject, chosen: Sequence[Mutant], tests: Coverage, jobs: int, tell: Tell) -> list[Result]:
    """A process of its own imports and collects everything, tries the mutants in forks, and tells the verdicts."""
    if not chosen:
        return []
    told, to_tell = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(told)
        _silence()
        with os.fdopen(to_tell, "w") as pipe:
            inplace.collect(subject.tests, lambda collected: _campaign(subject, chosen, tests, jobs, collected, pipe),
                            tests.seconds)  # fmt: skip
        os._exit(0)
    os.close(to_tell)
    by_key, results = {(mutant.path, mutant.number): mutant for mutant in chosen}, list[Result]()
    with os.fdopen(told) as pipe:
        for line in pipe:
            path, number, verdict = json.loads(line)
            results.append(Result(by_key[path, number], Verdict(*verdict)))
            if len(results) % EVERY == 0:
                tell(results)
    os.waitpid(pid, 0)
    return results


def _campaign(
    subject: Subject, chosen: Sequence[Mutant], tests: Coverage, jobs: int, collected: Collected, pipe: TextIO
) -> None:
    gc.freeze()

    def begin(mutant: Mutant) -> Trial | None:
        module = sys.modules.get(_module(mutant.path))
        function = inplace.function_of(module, mutant.place.scope) if module else None
        if function is None:
            return None
        path, noticing = subject.root / mutant.path, tests.noticing(mutant.path, mutant.place.first_line, False)
        tree = mutated(path.read_text(), mutant.number, subject.enums)
        kept = function.__code__
        if not inplace.patch(function, tree, str(path)):
            return None
        function.__code__ = kept
        return collected.begin(function, tree, str(path), noticing)

    for result in _tried(chosen, jobs, begin, [], lambda _: None):
        mutant, verdict = result.mutant, result.verdict
        row = (mutant.path, mutant.number, (verdict.killed, verdict.by, verdict.seconds))
        print(json.dumps(row), file=pipe, flush=True)


def _begin_anew(subject: Subject, mutant: Mutant, tests: Coverage) -> Trial:
    path, place = subject.root / mutant.path, mutant.place
    noticing = tests.noticing(mutant.path, place.first_line, place.at_import)
    tree = mutated(path.read_text(), mutant.number, subject.enums)
    return trials.begin(path, _module(mutant.path), tree, noticing, tests.seconds)


def _silence() -> None:
    with open(os.devnull, "r+") as nothing:  # noqa: PTH123 - a descriptor is wanted
        for stream in (0, 1, 2):
            os.dup2(nothing.fileno(), stream)


def _module(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _looked_at(subject: Subject) -> Coverage:
    """Runs the tests once with probes, in processes of their own; imports here what they needed of code not mutated."""
    workers = os.cpu_count() or 1
    looks = [_begin_look(subject, worker, workers) for worker in range(workers)]
    tests, modules = Coverage(), dict[str, None]()
    for pid, told in looks:
        with os.fdopen(told) as pipe:
            lines, seconds, failed, imported = json.loads(pipe.read())
        os.waitpid(pid, 0)
        tests.lines.update({test: {(path, line) for path, line in places} for test, places in lines.items()})
        tests.seconds.update(seconds)
        tests.failed.extend(failed)
        modules.update(dict.fromkeys(imported))
    if tests.failed or not tests.lines:
        failed = ", ".join(tests.failed) or "none was found"
        raise CheckFailed(f"without any mutant tests fail: {failed}; mend them first")
    trials.warm(modules)
    return tests


def _begin_look(subject: Subject, worker: int, workers: int) -> tuple[int, int]:
    """A process that runs its share of the tests; its number, and where it tells what it saw."""
    told, tell = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(told)
        _silence()
        tests = _observed(subject, worker, workers)
        with os.fdopen(tell, "w") as pipe:
            json.dump([{test: sorted(lines) for test, lines in tests.lines.items()}, tests.seconds, tests.failed,
                       trials.imported()], pipe)  # fmt: skip
        os._exit(0)
    os.close(tell)
    return pid, told


def _observed(subject: Subject, worker: int, workers: int) -> Coverage:
    ran: dict[str, dict[int, int]] = {path: {} for path in subject.paths}
    trees = {path: with_probes(ast.parse((subject.root / path).read_text())) for path in subject.paths}
    codes = {_module(path): compile(tree, str(subject.root / path), "exec") for path, tree in trees.items()}
    sys.meta_path.insert(0, trials.Instead(codes, {_module(path): {RAN: ran[path]} for path in subject.paths}))
    observer = Observer(ran, worker, workers)
    pytest.main([*trials.OPTIONS, *subject.tests], plugins=[observer])
    return observer.tests


def _check_unchanged(subject: Subject, tests: Coverage) -> None:
    """A file put in its own place must pass, or every mutant would be killed by the way it is tried: the first one."""
    path = subject.paths[0]
    quickest = tests.noticing(path, 0, at_import=True)[:CONTROLS]
    trial = trials.begin(subject.root / path, _module(path), ast.parse((subject.root / path).read_text()), quickest,
                         tests.seconds)  # fmt: skip
    while (verdict := trial.poll()) is None:
        time.sleep(POLL_S)
    if verdict.killed:
        raise CheckFailed(f"{path}: tests fail although nothing is changed: {verdict.by}")
