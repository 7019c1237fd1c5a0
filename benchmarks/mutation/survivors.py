"""The list of mutants that no test kills, each with its reason, held against what a run found."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

from benchmarks.mutation.mutants import Mutant
from benchmarks.mutation.run import Result
from rig.errors import DataError

Listed: TypeAlias = Mapping[tuple[str, str], str]
"""Reason by file and name of the mutant."""


def listed(path: Path) -> dict[tuple[str, str], str]:
    """What the file lists: a table a mutated file, in it the reason by the mutant's name."""
    tables = tomllib.loads(path.read_text()) if path.exists() else {}
    reasons = {(file, name): str(reason) for file, table in tables.items() for name, reason in table.items()}
    for (file, name), reason in reasons.items():
        if not reason.strip():
            raise DataError(f"{path}: {file}, {name}: no reason is given why no test kills it")
    return reasons


def unlisted(results: Sequence[Result], reasons: Listed) -> list[str]:
    """Sentences: mutants that survived and are not on the list."""
    left = [result.mutant for result in results if not result.verdict.killed]
    return [
        f"{mutant.path}:{mutant.place.line}: survived and is not listed: {mutant.name}"
        for mutant in left
        if (mutant.path, mutant.name) not in reasons
    ]


def untrue(results: Sequence[Result], reasons: Listed, mutants: Sequence[Mutant]) -> list[str]:
    """Sentences: what the list says of mutants that were killed, or that there are not."""
    wrong = [
        f"{mutant.path}:{mutant.place.line}: listed, but killed by {verdict.by}: {mutant.name}"
        for mutant, verdict in ((result.mutant, result.verdict) for result in results)
        if verdict.killed and (mutant.path, mutant.name) in reasons
    ]
    paths = {mutant.path for mutant in mutants}
    gone = set(reasons) - {(mutant.path, mutant.name) for mutant in mutants}
    return wrong + [f"{path}: listed, but no mutant: {name}" for path, name in sorted(gone) if path in paths]
