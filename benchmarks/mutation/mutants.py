"""Mutants of a module, each with a name that stays the same while other lines come and go."""

import ast
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.mutation.edits import Place, edits
from benchmarks.mutation.operators import Enums, enums_in


@dataclass(frozen=True)
class Mutant:
    """Number ``number`` of the edits of a file; ``name`` is scope, before and after."""

    path: str
    number: int
    place: Place
    name: str


def enums_of(paths: Iterable[Path]) -> dict[str, list[str]]:
    """Enumerations that the files define."""
    return {name: members for path in paths for name, members in enums_in(ast.parse(path.read_text())).items()}


def mutants_of(path: Path, shown: str, enums: Enums) -> list[Mutant]:
    """All mutants of one file, in the order of its edits; equal names of one scope are numbered."""
    # All edits first: to name one, the tree they are found by is changed for a moment.
    found = [(edit.place, f"{edit.place.scope or 'module'}: {edit.name}")
             for edit in list(edits(ast.parse(path.read_text()), enums))]  # fmt: skip
    seen: Counter[str] = Counter()
    mutants = []
    for number, (place, name) in enumerate(found):
        seen[name] += 1
        mutants.append(Mutant(shown, number, place, name if seen[name] == 1 else f"{name} #{seen[name]}"))
    return mutants


def mutated(source: str, number: int, enums: Enums) -> ast.Module:
    """The module's tree with that edit made."""
    tree = ast.parse(source)
    list(edits(tree, enums))[number].apply()
    return ast.fix_missing_locations(tree)
